"""How a table is written: LaTeX, Markdown, CSV and HTML."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path

from parapoint.files.targets import write_text
from reports.tables.table import Cell, Column, Table, Value, grouped

PAGE = 45
"""Rows of a LaTeX table on one page."""

Rows = tuple[tuple[Cell, ...], ...]


def write(made: Sequence[Table], folder: Path) -> None:
    """Write each table to `folder` as LaTeX, Markdown, CSV and HTML."""
    folder.mkdir(parents=True, exist_ok=True)
    for table in made:
        write_text(folder / f"{table.name}.tex", latex(table))
        write_text(folder / f"{table.name}.md", markdown(table))
        write_text(folder / f"{table.name}.csv", comma_separated(table))
        write_text(folder / f"{table.name}.html", html(table.title, [table]))


_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"$<$",
    ">": r"$>$",
    "|": r"$|$",
    "↓": r"$\downarrow$",
    "↑": r"$\uparrow$",
    "∞": r"$\infty$",
    "−": r"$-$",
    "–": "--",
    "±": r"$\pm$",
    "·": r"$\cdot$",
    "×": r"$\times$",
    "≤": r"$\leq$",
    "→": r"$\rightarrow$",
    "†": r"\dag{}",
    "σ": r"$\sigma$",
    "“": "``",
    "”": "''",
}


_SUPERSCRIPTS = "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"
_LOWERED = str.maketrans(_SUPERSCRIPTS, "-0123456789")


def latex_text(text: str) -> str:
    """`text` with every character that LaTeX reads otherwise escaped; others outside ASCII as ?."""
    text = " ".join(text.split())
    pieces = re.split(rf"(·10[{_SUPERSCRIPTS}]+)", text)
    return "".join(
        rf"$\cdot 10^{{{piece[3:].translate(_LOWERED)}}}$"
        if piece.startswith("·10") and len(piece) > 3
        else "".join(_LATEX.get(c, c if c.isascii() and c.isprintable() else "?") for c in piece)
        for piece in pieces
    )


def latex(table: Table) -> str:
    """The table as LaTeX floats of at most a page; needs the packages booktabs and graphicx."""
    parts = _pages(table.cells)
    floats = (
        _latex_float(table, part, number, last=number == len(parts) - 1)
        for number, part in enumerate(parts)
    )
    return "\n".join(["% needs \\usepackage{booktabs,graphicx}", *floats, ""])


def _pages(blocks: Sequence[Rows]) -> list[list[Rows]]:
    """Blocks by page: PAGE rows at most, a block parted only where it is longer than that."""
    pieces = [block[at : at + PAGE] for block in blocks for at in range(0, len(block), PAGE)]
    pages: list[list[Rows]] = [[]]
    for piece in pieces:
        if pages[-1] and sum(map(len, pages[-1])) + len(piece) > PAGE:
            pages.append([])
        pages[-1].append(piece)
    return pages


def _latex_float(table: Table, blocks: Sequence[Rows], number: int, *, last: bool) -> str:
    """One float of the table; only the first has the caption and the label."""
    columns = table.columns
    lines = [
        rf"\begin{{table}}[{'t' if last and not number else 'p'}]",
        r"\centering",
        *(
            [r"\addtocounter{table}{-1}", r"\caption{(Continued.)}"]
            if number
            else [rf"\caption{{{latex_text(table.caption)}}}", rf"\label{{tab:{table.name}}}"]
        ),
        r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
        r"\begin{tabular}{" + "".join("l" if column.text else "r" for column in columns) + "}",
        r"\toprule",
    ]
    groups = grouped(columns)
    if any(name for name, _ in groups):
        heads, rules, at = [], [], 1
        for name, width in groups:
            heads.append(rf"\multicolumn{{{width}}}{{c}}{{{latex_text(name)}}}" if name else "")
            heads.extend([""] * (width - 1) if not name else [])
            if name:
                rules.append(rf"\cmidrule(lr){{{at}-{at + width - 1}}}")
            at += width
        lines += [" & ".join(heads) + r" \\", " ".join(rules)]
    lines.append(" & ".join(latex_text(column.head) for column in columns) + r" \\")
    for block in blocks:
        lines.append(r"\midrule")
        for at, row in enumerate(block):
            cells = [
                "" if at and column.once else _latex_cell(cell)
                for column, cell in zip(columns, row, strict=True)
            ]
            lines.append(" & ".join(cells) + r" \\")
    lines += [r"\bottomrule", r"\end{tabular}}"]
    if table.notes and last:
        notes = r" \\ ".join(latex_text(note) for note in table.notes)
        lines.append(rf"\par\smallskip\parbox{{\linewidth}}{{\footnotesize {notes}}}")
    return "\n".join([*lines, r"\end{table}"])


def _latex_cell(cell: Cell) -> str:
    text = latex_text(cell.text)
    return {"best": rf"\textbf{{{text}}}", "second": rf"\underline{{{text}}}"}.get(cell.mark, text)


def markdown(table: Table) -> str:
    """The table as Markdown; best in bold, second in italics."""

    def escaped(text: str) -> str:
        return re.sub(r"([\\`*_{}\[\]<>|#$~&])", r"\\\1", " ".join(text.split()))

    heads = [
        f"{column.group}: {column.head}" if column.group else column.head
        for column in table.columns
    ]
    lines = [
        f"### {escaped(table.title)}",
        "",
        "| " + " | ".join(escaped(head) for head in heads) + " |",
        "|" + "|".join(":---" if column.text else "---:" for column in table.columns) + "|",
    ]
    around = {"best": "**", "second": "*", "": ""}
    for block in table.cells:
        for number, row in enumerate(block):
            cells = [
                ""
                if number and column.once
                else f"{around[cell.mark]}{escaped(cell.text)}{around[cell.mark]}"
                for column, cell in zip(table.columns, row, strict=True)
            ]
            lines.append("| " + " | ".join(cells) + " |")
    lines += ["", escaped(table.caption), ""]
    lines += [line for note in table.notes for line in (f"- {escaped(note)}",)]
    return "\n".join(lines).rstrip() + "\n"


def comma_separated(table: Table) -> str:
    """The table as CSV: keys as heads, numbers in full, every row complete."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([_plain(column.key) for column in table.columns])
    for block in table.blocks:
        for row in block:
            writer.writerow([_plain(_full(row, column)) for column in table.columns])
    return out.getvalue()


def _plain(value: Value) -> Value:
    """A value that no spreadsheet computes: text that begins as a formula does gets a quote."""
    if isinstance(value, str) and value.lstrip().startswith(("=", "+", "-", "@")):
        return f"'{value}"
    return "" if value is None else value


def _full(row: Mapping[str, Value], column: Column) -> Value:
    """A value in full: a fraction as such, or as per cent where the row's own words say so."""
    value = row.get(column.key)
    percent = column.by_row and column.of(row).percent
    return 100 * value if percent and isinstance(value, int | float) else value


_CSS = """
:root { color-scheme: light dark }
body { font: 15px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif;
  margin: 2rem auto; max-width: 84rem; padding: 0 1.5rem }
.scroll { overflow-x: auto }
table { border-collapse: collapse; border-block: 1.5px solid; font-variant-numeric: tabular-nums }
tbody { border-top: 1px solid }
th, td { padding: .2rem .6rem; text-align: right; vertical-align: baseline; white-space: nowrap }
th { font-weight: 400; vertical-align: bottom }
th[colspan] { text-align: center }
.text { text-align: left }
.best { font-weight: 700 }
.second { text-decoration: underline }
p, ul { max-width: 52rem; font-size: .92rem }
"""


def html(title: str, tables: Sequence[Table], lead: str = "") -> str:
    """A page of tables that needs no other file, `lead` below its heading."""
    lines = [
        '<!doctype html>\n<html lang="en">\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>\n<style>{_CSS}</style>",
        f"<h1>{escape(title)}</h1>",
        *([f"<p>{escape(lead)}</p>"] if lead else []),
    ]
    for table in tables:
        if table.title != title:
            lines.append(f"<h2>{escape(table.title)}</h2>")
        lines += _html_table(table)
    return "\n".join(lines) + "\n</html>\n"


def _html_table(table: Table) -> Iterator[str]:
    """The lines of a table, its caption and its notes."""
    yield '<div class="scroll"><table>\n<thead>'
    groups = grouped(table.columns)
    if any(name for name, _ in groups):
        heads = (f'<th colspan="{width}" scope="colgroup">{escape(name)}' for name, width in groups)
        yield f"<tr>{''.join(heads)}"
    classes = ["text" if column.text else "" for column in table.columns]
    heads = (
        f'<th class="{kind}" scope="col">{escape(column.head)}'
        for kind, column in zip(classes, table.columns, strict=True)
    )
    yield f"<tr>{''.join(heads)}"
    for block in table.cells:
        yield "<tbody>"
        for number, row in enumerate(block):
            cells = (
                f'<td class="{kind} {cell.mark}">'
                f"{'' if number and column.once else escape(cell.text)}"
                for kind, column, cell in zip(classes, table.columns, row, strict=True)
            )
            yield f"<tr>{''.join(cells)}"
    yield f"</table></div>\n<p>{escape(table.caption)}</p>"
    if table.notes:
        yield f"<ul>{''.join(f'<li>{escape(note)}' for note in table.notes)}</ul>"
