"""One self-contained HTML page per experiment, which loads nothing, and an index over several.

The page begins with the table of figures: each with the article's value, the limit, and reached or missed.
"""

import contextlib
import html
import json
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from gravcomp import __version__
from gravcomp.report.result import Plot, Result, Table, number, plain

_LIBRARIES = ("numpy", "scipy", "numba", "proxsuite", "matplotlib", "filterpy")

_STYLE = """
:root { --ink: #1c232b; --soft: #5b6570; --line: #e1e5ea; --paper: #ffffff; --back: #f4f6f8; --good: #00724f;
  --bad: #b23b00; --accent: #0072b2; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--back); color: var(--ink);
  font: 15px/1.55 system-ui, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
main { max-width: 1020px; margin: 0 auto; padding: 36px 28px 64px; }
header p.kicker { margin: 0; color: var(--accent); font-weight: 600; letter-spacing: .04em; font-size: 13px; }
h1 { margin: 4px 0 8px; font-size: 30px; line-height: 1.2; letter-spacing: -.01em; }
h2 { margin: 0 0 10px; font-size: 17px; }
p.question { font-size: 17px; color: #37404a; margin: 0 0 14px; max-width: 72ch; }
p.ground { color: var(--soft); margin: 0; max-width: 86ch; }
section { background: var(--paper); border: 1px solid var(--line); border-radius: 10px; padding: 20px 22px;
  margin-top: 20px; overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: 14px; }
th { text-align: left; color: var(--soft); font-weight: 600; border-bottom: 2px solid var(--line); padding: 6px 14px 6px 0;
  vertical-align: bottom; }
td { border-bottom: 1px solid var(--line); padding: 7px 14px 7px 0; vertical-align: top; }
tr:last-child td { border-bottom: 0; }
td.value { font-weight: 650; white-space: nowrap; }
.badge { display: inline-block; padding: 1px 10px; border-radius: 999px; font-size: 12.5px; font-weight: 650;
  white-space: nowrap; }
.reached { background: #dff3ea; color: var(--good); }
.missed { background: #fde6da; color: var(--bad); }
p.note, p.caption { color: var(--soft); font-size: 13.5px; margin: 10px 0 0; max-width: 92ch; }
section svg { display: block; max-width: 100%; height: auto; margin: 0 auto; }
details summary { cursor: pointer; font-weight: 600; }
pre { font-size: 12.5px; line-height: 1.45; overflow-x: auto; background: var(--back); padding: 12px 14px; border-radius: 8px; }
ul.notes { margin: 0; padding-left: 20px; }
a { color: var(--accent); text-decoration: none; font-weight: 600; } a:hover { text-decoration: underline; }
footer { color: var(--soft); font-size: 13px; margin-top: 24px; }
@media print { body { background: #fff; } section { break-inside: avoid; } }
"""


_HEADER = "<th>figure</th><th>measured</th><th>article</th><th>limit</th><th></th>"


def versions() -> dict[str, str]:
    """Return the versions of gravcomp, Python and the libraries, and the machine."""
    found = {"gravcomp": __version__, "python": platform.python_version(), "machine": platform.machine()}
    for name in _LIBRARIES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def write_report(result: Result, folder: Path) -> Path:
    """Write NAME.html and NAME.json into the folder. Returns the path of the page."""
    folder.mkdir(parents=True, exist_ok=True)
    document = {**result.to_mapping(), "versions": versions()}
    (folder / f"{result.file}.json").write_text(json.dumps(document, indent=1), encoding="utf-8")
    page = folder / f"{result.file}.html"
    page.write_text(_page(result), encoding="utf-8")
    return page


def write_index(results: list[Result], folder: Path) -> Path:
    """Write index.html for the pages of several experiments. Returns its path."""
    rows = []
    for result in results:
        for place, figure in enumerate(result.figures):
            name = f'<a href="{result.file}.html">{html.escape(result.title)}</a>' if place == 0 else ""
            rows.append(f"<tr><td>{name}</td>{_figure_cells(figure)}</tr>")
    limited = [f for r in results for f in r.figures if f.reached is not None]
    reached = sum(bool(f.reached) for f in limited)
    body = f"""<header><p class="kicker">gravcomp</p><h1>The article's experiments, reproduced</h1>
<p class="question">{reached} of {len(limited)} figures with a limit reach it.
Each title links to a page with curves, shapes and parameters.</p>
<p class="ground">All runs use the virtual robot:
a geometrically exact rod whose parameters differ from those of the controller's model.</p>
</header>
<section><table><tr><th>experiment</th>{_HEADER}</tr>{"".join(rows)}</table></section>
<footer>{_footer()} · computing time {number(sum(r.seconds for r in results))} s</footer>"""
    path = folder / "index.html"
    path.write_text(_document("The article's experiments", body), encoding="utf-8")
    return path


def _page(result: Result) -> str:
    figures = "".join(f"<tr>{_figure_cells(figure)}</tr>" for figure in result.figures)
    parts = "".join(_table(part) if isinstance(part, Table) else _plot(part) for part in result.parts)
    notes = "".join(f"<li>{html.escape(note)}</li>" for note in result.notes)
    parameters = html.escape(json.dumps(plain(result.parameters), indent=1))
    body = f"""<header><p class="kicker">gravcomp {html.escape(result.command)}</p><h1>{html.escape(result.title)}</h1>
<p class="question">{html.escape(result.question)}</p><p class="ground">{html.escape(result.ground)}</p></header>
<section><table><tr>{_HEADER}</tr>{figures}</table></section>
{parts}
{f'<section><h2>Notes</h2><ul class="notes">{notes}</ul></section>' if notes else ""}
<section><details><summary>Parameters</summary><pre>{parameters}</pre></details></section>
<footer>{_footer()} · computing time {number(result.seconds)} s</footer>"""
    return _document(result.title, body)


def _document(title: str, body: str) -> str:
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style></head><body><main>{body}</main></body></html>"
    )


def _figure_cells(figure: Any) -> str:
    badge = {True: '<span class="badge reached">reached</span>', False: '<span class="badge missed">missed</span>', None: ""}
    cells = (figure.name, None, figure.article, figure.target)
    texts = [
        f'<td class="value">{html.escape(figure.text)}</td>' if cell is None else f"<td>{html.escape(cell)}</td>"
        for cell in cells
    ]
    return "".join(texts) + f"<td>{badge[figure.reached]}</td>"


def _table(table: Table) -> str:
    header = "".join(f"<th>{html.escape(cell)}</th>" for cell in table.header)
    rows = "".join("<tr>" + "".join(f"<td>{html.escape(number(cell))}</td>" for cell in row) + "</tr>" for row in table.rows)
    note = f'<p class="note">{html.escape(table.note)}</p>' if table.note else ""
    return f"<section><h2>{html.escape(table.title)}</h2><table><tr>{header}</tr>{rows}</table>{note}</section>"


def _plot(plot: Plot) -> str:
    caption = f'<p class="caption">{html.escape(plot.caption)}</p>' if plot.caption else ""
    return f"<section><h2>{html.escape(plot.title)}</h2>{plot.svg}{caption}</section>"


def _footer() -> str:
    return html.escape(" · ".join(f"{name} {version}" for name, version in versions().items()))
