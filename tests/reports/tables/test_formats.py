import csv
import dataclasses
import io
import math
import re
import shutil
import subprocess

import pytest

from reports.contents import contents
from reports.tables.formats import comma_separated, html, latex, latex_text, markdown
from reports.tables.suites import everything, tables

from ..conftest import HOSTILE
from .test_table import table


def test_latex_escapes_everything_that_latex_reads():
    assert latex_text("a_b & 50% #1 {x} ~^\\ $") == (
        r"a\_b \& 50\% \#1 \{x\} \textasciitilde{}\textasciicircum{}\textbackslash{} \$"
    )
    assert latex_text("2.5·10⁷") == r"2.5$\cdot 10^{7}$"
    assert latex_text("1.0·10⁻³ ∞ ↓") == r"1.0$\cdot 10^{-3}$ $\infty$ $\downarrow$"
    assert latex_text("数\x00") == "??"


def is_balanced(text):
    """Whether braces and environments of LaTeX source match, and every row has all its columns."""
    bare = re.sub(r"\\[\\{}%&$#_]", "", text)
    depth = 0
    for sign in bare:
        depth += {"{": 1, "}": -1}.get(sign, 0)
        if depth < 0:
            return False
    begun = re.findall(r"\\begin\{(\w+)\}", text)
    return depth == 0 and begun == re.findall(r"\\end\{(\w+)\}", text)[::-1]


def column_counts(text):
    spec = re.search(r"\\begin\{tabular\}\{([lr]+)\}", text).group(1)
    body = text[text.index(r"\toprule") : text.index(r"\bottomrule")]
    found = set()
    for line in body.splitlines():
        if not line.endswith(r"\\") or line.startswith("\\multicolumn{0"):
            continue
        spans = sum(int(n) - 1 for n in re.findall(r"\\multicolumn\{(\d+)\}", line))
        found.add(len(re.findall(r"(?<!\\)&", line)) + 1 + spans)
    return len(spec), found


def test_every_latex_table_is_well_formed(results):
    suite = contents(results)[0]
    for made in [*tables(suite), everything(suite)]:
        text = latex(made)
        assert is_balanced(text), made.name
        width, found = column_counts(text)
        assert found == {width}, made.name
        assert r"\toprule" in text
        assert "<script>" not in text


def test_a_long_latex_table_goes_over_several_pages():
    rows = [{"name": "x", "a": float(k)} for k in range(100)]
    text = latex(table(*rows, notes=("end",)))
    assert is_balanced(text)
    assert text.count(r"\begin{table}[p]") == text.count(r"\toprule") == 3
    assert text.count(r"\label") == text.count("C\\_1") == text.count("footnotesize end") == 1
    assert text.count("\nx & ") == 3  # what stands once stands once a page
    assert "99.00" in text


@pytest.mark.parametrize(("lengths", "pages"), [((20, 25), 1), ((20, 26), 2), ((40, 46), 3)])
def test_a_block_is_parted_only_where_it_is_longer_than_a_page(lengths, pages):
    blocks = tuple(tuple({"name": "x", "a": 1.0} for _ in range(count)) for count in lengths)
    text = latex(dataclasses.replace(table(), blocks=blocks))
    assert text.count(r"\toprule") == pages
    assert text.count(r"\begin{table}[t]") == (pages == 1)


def test_latex_compiles(results, tmp_path):
    engine = next((e for e in ("pdflatex", "xelatex", "tectonic") if shutil.which(e)), None)
    if engine is None:
        pytest.skip("no LaTeX engine on this machine; the structure is checked above")
    made = "\n".join(latex(table) for table in tables(contents(results)[0]))
    source = tmp_path / "t.tex"
    source.write_text(
        "\\documentclass{article}\\usepackage{booktabs,graphicx}\\begin{document}\n"
        f"{made}\\end{{document}}\n"
    )
    options = [] if engine == "tectonic" else ["-interaction=nonstopmode", "-halt-on-error"]
    done = subprocess.run(
        [engine, *options, source.name], cwd=tmp_path, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]


def test_markdown_marks_and_escapes():
    text = markdown(table({"name": "a|b", "a": 0.1, "b": 0.1}, {"name": "a|b", "a": 0.2, "b": 0.2}))
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert lines[0] == "| Name | G: A ↓ | G: B % ↑ | C |"
    assert lines[2] == "| a\\|b | **0.10** | *10.0* | – |"
    assert lines[3] == "|  | *0.20* | **20.0** | – |"
    assert "C\\_1" in text


def test_csv_has_full_numbers_in_every_row():
    made = table({"name": "x", "a": 1 / 3, "b": 0.5}, {"name": "x", "a": math.inf})
    rows = list(csv.DictReader(io.StringIO(comma_separated(made))))
    assert [row["name"] for row in rows] == ["x", "x"]
    assert float(rows[0]["a"]) == 1 / 3
    assert rows[1]["a"] == "inf"
    assert rows[1]["b"] == ""


def test_html_escapes_marks_and_blanks_what_stands_once():
    made = table({"name": HOSTILE, "a": 0.1}, {"name": HOSTILE, "a": 0.2}, notes=("a < b",))
    text = html("A & B", [made], lead="<i>")
    assert "<script>" not in text
    assert text.count("&lt;script&gt;") == 1
    assert '<td class=" best">0.10' in text
    assert '<td class=" second">0.20' in text
    assert '<th colspan="2" scope="colgroup">G' in text
    assert "<h1>A &amp; B</h1>" in text
    assert "<h2>T</h2>" in text
    assert "<li>a &lt; b" in text
