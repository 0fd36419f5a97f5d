"""HTML of a report: every text escaped, every picture inside, nothing fetched."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape

from formats.errors import printable

LONGEST = 2000  # characters of a text from a file
# Nothing but what is in the page itself may be loaded, whatever a file's text says.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
STYLE = """
:root { color-scheme: light; --ink: #1b1b1b; --soft: #5f6368; --line: #d9dce0; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2rem 1.5rem 4rem; max-width: 62rem; color: var(--ink);
  background: #fff; font: 15px/1.5 system-ui, "Segoe UI", Roboto, "Liberation Sans", sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .2rem; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; padding-bottom: .25rem;
  border-bottom: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1.4rem 0 .4rem; }
p { margin: .5rem 0; max-width: 46rem; }
.soft, figcaption { color: var(--soft); }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .8rem .25rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--line); overflow-wrap: anywhere; }
th { font-weight: 600; color: var(--soft); }
td.n, th.n { text-align: right; white-space: nowrap; }
.big { display: flex; gap: 2.2rem; flex-wrap: wrap; margin: 1.2rem 0; }
.big div { min-width: 7rem; }
.big b { display: block; font-size: 1.9rem; line-height: 1.1; }
.row { display: grid; grid-template-columns: repeat(auto-fit, minmax(17rem, 1fr)); gap: 1.2rem; }
figure { margin: .4rem 0; break-inside: avoid; }
figure svg, figure img { width: 100%; height: auto; border: 1px solid var(--line); display: block; }
figcaption { font-size: .87rem; margin-top: .3rem; }
.key { white-space: nowrap; margin-left: .5em; }
.swatch { display: inline-block; width: .8em; height: .8em; margin-right: .3em; }
code { font: .92em ui-monospace, "Liberation Mono", monospace; overflow-wrap: anywhere; }
li { overflow-wrap: anywhere; }
@media print {
  body { max-width: none; padding: 0; font-size: 10.5pt; }
  h2 { break-after: avoid; } tr, figure, .big { break-inside: avoid; }
  .row { grid-template-columns: repeat(2, 1fr); } a { color: inherit; }
}
@page { margin: 16mm; }
"""


def text(value: object) -> str:
    """Text from anywhere, safe in a page: markup escaped, control characters made visible."""
    return escape(printable(value, LONGEST), quote=True)


def page(title: str, body: Iterable[str]) -> str:
    """A whole HTML file."""
    head = (
        f'<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="icon" href="data:,"><title>{text(title)}</title><style>{STYLE}</style>'
    )
    inside = "\n".join(body)
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body>\n{inside}\n</body></html>\n'


def table(head: Sequence[str], rows: Iterable[Sequence[object]], numbers: int = 0) -> str:
    """A table of texts; the last `numbers` columns are set to the right."""
    first = len(head) - numbers

    def cells(row: Sequence[object], tag: str) -> str:
        kinds = ["" if i < first else ' class="n"' for i in range(len(row))]
        return "".join(
            f"<{tag}{kind}>{text(cell)}</{tag}>" for kind, cell in zip(kinds, row, strict=True)
        )

    body = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in rows)
    top = f"<thead><tr>{cells(head, 'th')}</tr></thead>" if any(head) else ""
    return f"<table>{top}<tbody>{body}</tbody></table>"


def bullets(items: Iterable[object]) -> str:
    """A list of texts."""
    return "<ul>" + "".join(f"<li>{text(item)}</li>" for item in items) + "</ul>"


def figure(inside: str, caption: str) -> str:
    """A picture (markup of ours) with its caption (markup, too)."""
    return f"<figure>{inside}<figcaption>{caption}</figcaption></figure>"


def key(colour: tuple[int, int, int], name: str) -> str:
    """An entry of a legend."""
    red, green, blue = colour
    swatch = f'<span class="swatch" style="background:rgb({red},{green},{blue})"></span>'
    return f' <span class="key">{swatch}{text(name)}</span>'


def picture(png: bytes, alternative: str) -> str:
    """A PNG inside the page."""
    return f'<img alt="{text(alternative)}" src="{data_url(png)}">'


def data_url(png: bytes) -> str:
    """A PNG as an address that needs no network."""
    return "data:image/png;base64," + base64.b64encode(png).decode()
