"""What `replay run` prints: how it chose, and the scores."""

from __future__ import annotations

from typing import Any

from formats.errors import printable
from formats.result import Result

ROWS = {"none": "no prior", "bayes": "prior, bayes", "paper": "prior, paper"}


def run_report(result: Result) -> str:
    """Lines that a person reads, without the last line break."""
    facts = result.facts
    lines = [_line(word, text) for word, texts in facts["said"].items() for text in texts]
    skipped = f", {facts['skipped']} skipped" if facts["skipped"] else ""
    lost = f", {facts['lost']} lost" if facts["lost"] else ""
    took, span = facts["seconds"]["whole"], facts["log_seconds"]
    mapped = f"{facts['scans']} scans{skipped}{lost}, {span:.1f} s in {took:.1f} s"
    if facts["plan"] or facts["truth"]:
        lines.append(
            _line("map", f"{mapped}, {facts['explored']:.0%} of the scored cells observed")
        )
        lines += score_table(facts)
        lines += metric_table(facts) + sure_table(facts)
        if "walls" in facts:
            lines.append(_line("walls", walls_line(facts["walls"]["metres"])))
    else:
        lines += [_line("map", mapped), _line("score", facts["against"])]
    for path in facts["written"]:
        lines.append(_line("wrote", printable(path)))
    return "\n".join(lines)


def walls_line(metres: dict[str, float]) -> str:
    """How the plan's walls were found, by length; `replay deviation` tells them one by one."""
    seen = sum(metres[state] for state in ("confirmed", "moved", "not there"))
    if not seen:
        return f"none of the plan's {metres['unseen']:.0f} m was seen"
    shares = ", ".join(f"{metres[s] / seen:.0%} {s}" for s in ("confirmed", "moved", "not there"))
    return f"{seen:.0f} m of the plan's {seen + metres['unseen']:.0f} m seen: {shares}"


def _line(word: str, text: str) -> str:
    return f"{word:<8}{text}"


def score_table(facts: dict[str, Any]) -> list[str]:
    """Precision, recall and F2 over the scored region, and F2 in its two parts."""
    head = f"{facts['against']:<34}{'precision':>9}{'recall':>8}{'F2':>7}"
    lines = [_line("score", f"{head}{'observed F2':>14}{'unobserved F2':>15}")]
    for curve, scores in facts["scores"].items():
        sensor = facts["sensor"][curve]
        name = f"{ROWS[curve]} ({sensor})"
        seen, unseen = facts["observed"][curve]["f2"], facts["unobserved"][curve]["f2"]
        numbers = f"{scores['precision']:>9.2f}{scores['recall']:>8.2f}{scores['f2']:>7.2f}"
        lines.append(_line("", f"{name:<34}{numbers}{seen:>14.2f}{unseen:>15.2f}"))
    return lines


def metric_table(facts: dict[str, Any]) -> list[str]:
    """The metrics that were asked for, one column each."""
    found = facts.get("metrics", {})
    names = list(next(iter(found.values()), {}))
    if not names:
        return []
    wide = {name: max(len(name) + 2, 9) for name in names}
    lines = [_line("metric", " " * 34 + "".join(f"{name:>{wide[name]}}" for name in names))]
    for curve, values in found.items():
        cells = ("-" if values[n] is None else f"{values[n]:.3f}" for n in names)
        numbers = "".join(f"{cell:>{wide[n]}}" for n, cell in zip(names, cells, strict=True))
        name = f"{ROWS[curve]} ({facts['sensor'][curve]})"
        lines.append(_line("", f"{name:<34}{numbers}"))
    return lines


def sure_table(facts: dict[str, Any]) -> list[str]:
    """F2 with its interval, and the gain of each prior with its own and its p."""
    lines: list[str] = []
    for curve, values in facts.get("intervals", {}).items():
        low, high = values["f2"]
        gain = facts["gain"].get(curve, {}).get("f2")
        text = f"{ROWS[curve]:<34}F2 {low:.2f} to {high:.2f}"
        if gain:
            text += f", {gain['difference']:+.2f} over none ({gain['low']:+.2f} to "
            text += f"{gain['high']:+.2f}, p {gain['p']:.2g})"
        lines.append(_line("" if lines else "sure", text))
    return lines
