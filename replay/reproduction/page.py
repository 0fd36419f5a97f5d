"""The reproduction as one HTML page that needs nothing else."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape

from replay.reproduction.claims import Claim, Section, Table

STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1080px; margin: 2em auto; padding: 0 1em;
  color: #1b1b1b; }
h1 { font-size: 1.6em; } h2 { margin-top: 2.2em; border-bottom: 1px solid #ccc; font-size: 1.25em; }
table { border-collapse: collapse; margin: 1em 0; font-size: 13px; }
caption { text-align: left; font-weight: 600; padding: .3em 0; }
th, td { border-bottom: 1px solid #ddd; padding: .25em .6em; text-align: left;
  vertical-align: top; }
th { background: #f4f4f4; }
.wide { overflow-x: auto; }
figure { margin: 1.2em 0; } figure img { max-width: 100%; height: auto; }
figcaption { font-size: 13px; color: #444; }
.verdict { white-space: nowrap; font-weight: 600; }
.holds { color: #00664b; } .not { color: #a33c00; } .untested { color: #666; }
.setup { color: #444; }
"""
CLASSES = {"holds": "holds", "does not hold": "not", "cannot be tested": "untested"}
ABOUT = """Georgiou, Anderson, Dodd (2017), <i>Constructing informative Bayesian map priors</i>,
IJRR, doi 10.1177/0278364916687027. Every experiment of the paper, made anew on drawings of our own
with exact truth, and on recorded logs where they are there. A verdict is about the claim on these
data, with the tolerances that its numbers show; where the paper is silent or contradicts itself,
ids such as A5 refer to the project's page on the paper. "paper" is the update as Equation 5 prints
it, "bayes" the consistent one."""


def page(title: str, sections: Sequence[Section], notes: Sequence[str] = ()) -> str:
    """The whole page.

    Args:
        title: of it.
        sections: in their order.
        notes: lines below the heading.
    """
    claims = [(section.row, claim) for section in sections for claim in section.claims]
    counts = ", ".join(
        f"{sum(claim.verdict == verdict for _, claim in claims)} {said}"
        for verdict, said in (
            ("holds", "hold"),
            ("does not hold", "do not hold"),
            ("cannot be tested", "cannot be tested"),
        )
    )
    body = [
        f"<h1>{escape(title)}</h1>",
        f"<p>{ABOUT}</p>",
        *(f"<p class='setup'>{escape(note)}</p>" for note in notes),
        f"<h2 id='claims'>Claims: {counts}</h2>",
        _claims(claims),
        *(_section(section) for section in sections),
    ]
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>{escape(title)}</title><style>{STYLE}</style></head><body>\n"
        + "\n".join(body)
        + "\n</body></html>\n"
    )


def _claims(claims: Sequence[tuple[str, Claim]]) -> str:
    rows = "".join(
        f"<tr><td><a href='#{row}'>{row}</a></td><td>{escape(claim.text)}</td>"
        f"<td class='verdict {CLASSES[claim.verdict]}'>{claim.verdict}</td>"
        f"<td>{escape(claim.numbers)}"
        + (f"<br><i>{escape(claim.why)}</i>" if claim.why else "")
        + "</td></tr>"
        for row, claim in claims
    )
    head = "<tr><th>row</th><th>claim</th><th>verdict</th><th>numbers, and why</th></tr>"
    return f"<div class='wide'><table>{head}{rows}</table></div>"


def _section(section: Section) -> str:
    parts = [f"<h2 id='{section.row}'>{section.row}: {escape(section.title)}</h2>"]
    if section.setup:
        parts.append(f"<p class='setup'>{escape(section.setup)}</p>")
    if section.claims:
        parts.append(_claims([(section.row, claim) for claim in section.claims]))
    parts += [_table(table) for table in section.tables]
    for caption, png in section.figures:
        data = b64encode(png).decode()
        parts.append(
            f"<figure><img alt='{escape(caption, quote=True)}' src='data:image/png;base64,{data}'>"
            f"<figcaption>{escape(caption)}</figcaption></figure>"
        )
    return "\n".join(parts)


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(str(cell))}</th>" for cell in table.head)
    rows = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>"
        for row in table.rows
    )
    return (
        f"<div class='wide'><table><caption>{escape(table.caption)}</caption>"
        f"<tr>{head}</tr>{rows}</table></div>"
    )
