"""What `replay tune` prints: a table that a person reads."""

from __future__ import annotations

from typing import Any

from formats.errors import printable

RULES = {"bayes": "Bayes' rule", "paper": "Equation 5 as printed"}
E11 = "p_wall .2 with p_space .6 to 1; p_wall .4 to .5 with p_space .7 to .8"


def report(facts: dict[str, Any]) -> str:
    """Lines without the last line break."""
    lines = []
    for name, rule in facts["rules"].items():
        lines += [*_rule(name, rule, facts["search"], len(facts["sources"]) > 1), ""]
    for path, depends in facts["poses_depend_on"].items():
        name = printable(path.rsplit("/", 1)[-1])
        lines.append(f"poses   of {name} depend on more than its log: {depends}")
    chosen = facts["chosen"]
    lines.append(
        f"chosen  {chosen['pick']}: p_wall {chosen['p_wall']:.3f}, p_space "
        f"{chosen['p_space']:.3f} (P(EMPTY), times {chosen['prior_scale']:g} before use), "
        f"for {chosen['update']} and a sensor of {chosen['p_hit']:g} / {chosen['p_miss']:g}"
    )
    lines += [f"wrote   {printable(path)}" for path in facts["written"]]
    return "\n".join(lines)


def _rule(name: str, rule: dict[str, Any], search: dict[str, Any], several: bool) -> list[str]:
    front, found = rule["front"], rule["search"]
    kind = "exact front" if front["exact"] else "front of the grid (no exact one: --cell-rule)"
    worst = f"{'worst F2':>10}" if several else ""
    head = f"{'':<10}{'p_wall':>7}{'p_space':>8}{'precision':>11}{'recall':>8}{'F2':>7}{worst}"
    lines = [
        f"{name:<8}{RULES[name]}, sensor {rule['sensor']}; {rule['cells']:,} scored, "
        f"{rule['walls']:,} wall",
        f"front   {kind}: {front['points']} points, {front['acceptable']} with precision and "
        f"recall above 40 %, hypervolume {front['hypervolume']:.4f}",
        f"search  {search['algorithm']}, {search['objective']} objective, seed {search['seed']}: "
        f"{found['evaluations']:,} evaluations, {found['generations']} generations; its front "
        f"{found['front_share_of_hypervolume']:.4f} and all it evaluated "
        f"{found['archive_share_of_hypervolume']:.4f} of the exact hypervolume",
        f"prior   {head}{'early F2':>10}",
    ]
    rows = {"no prior": {"p_wall": 0.5, "p_space": 0.5, **rule["no_prior"]}, **rule["picks"]}
    for title, row in rows.items():
        worst = f"{row['worst_f2']:>10.3f}" if several else ""
        mark = "  breaks E13" if row.get("equation_13") else ""
        lines.append(
            f"        {title:<10}{row['p_wall']:>7.3f}{row['p_space']:>8.3f}"
            f"{row['precision']:>11.3f}{row['recall']:>8.3f}{row['f2']:>7.3f}{worst}"
            f"{row['early_f2']:>10.3f}{mark}"
        )
    groups = "; ".join(
        f"{c['points']} about ({c['p_wall']:.2f}, {c['p_space']:.2f})" for c in rule["clusters"]
    )
    lines.append(f"groups  {groups or 'none: no prior gives precision and recall above 40 %'}")
    near = "; ".join(
        f"p_wall {row['p_wall']:g} with p_space {_range(row['p_space'])}"
        for row in rule["shortlist"]
    )
    lines.append(f"short   {near or 'none'} (F2 within .01 of the best of the tenths)")
    lines.append(f"        the paper's (Equation 11): {E11}")
    if rule["doors"]:
        doors = rule["doors"]
        lines.append(
            f"doors   best with p_door {doors['p_door_from']:.2f} to {doors['p_door_to']:.2f}: "
            f"F2 {doors['f2']:.3f}"
        )
    if rule["sensors"]:
        best = rule["sensors"]
        lines.append(
            f"sensor  best with p_hit / p_miss {best['p_hit']:g} / {best['p_miss']:g}: F2 "
            f"{best['f2']:.3f} at ({best['p_wall']:.2f}, {best['p_space']:.2f}); without a prior "
            f"{best['f2_without_prior']:.3f}"
        )
    return lines


def _range(values: list[float]) -> str:
    """0.6, 0.7, 0.8 as ".6 to .8", gaps kept."""
    runs: list[list[float]] = []
    for value in values:
        if runs and round(value - runs[-1][-1], 6) <= 0.1:
            runs[-1].append(value)
        else:
            runs.append([value])
    return ", ".join(f"{r[0]:g} to {r[-1]:g}" if len(r) > 1 else f"{r[0]:g}" for r in runs)
