import csv
import io
import math
import re
import shutil
import subprocess

import pytest

from reports.contents import contents
from reports.formats import comma_separated, latex, latex_text, markdown
from reports.table import Column, Table
from reports.tables import comparison, conformality, everything, failures, supplement, tables

from .conftest import DEVIL, HAND, HOSTILE, NEFERTITI

COLUMNS = (
    Column("name", "Name", text=True, once=True),
    Column("a", "A", better="lower", digits=2, group="G"),
    Column("b", "B", better="higher", digits=1, percent=True, group="G"),
    Column("c", "C", digits=0),
)


def table(*rows, **given):
    return Table("t", "T", "C_1", COLUMNS, (rows,), **given)


def marks(made):
    return [[cell.mark for cell in row] for block in made.cells for row in block]


def test_best_and_second_by_direction_and_ties_by_what_is_printed():
    made = table(
        {"name": "x", "a": 0.101, "b": 0.1, "c": 1.0},
        {"name": "x", "a": 0.10, "b": 0.5, "c": 2.0},
        {"name": "x", "a": 0.2, "b": 0.3, "c": 3.0},
        {"name": "x", "a": 0.3, "b": None, "c": 3.0},
        {"name": "x", "a": math.inf, "b": math.nan, "c": 3.0},
    )
    assert marks(made) == [
        ["", "best", "", ""],
        ["", "best", "best", ""],
        ["", "second", "second", ""],
        ["", "", "", ""],
        ["", "", "", ""],
    ]


def test_a_method_set_apart_is_not_ranked():
    rows = [{"label": "atlas", "a": 0.1}, {"label": "p", "a": 0.2}, {"label": "q", "a": 0.3}]
    assert [row[1] for row in marks(table(*rows, set_apart=frozenset({"atlas"})))] == [
        "",
        "best",
        "second",
    ]


def test_ranks_across_a_row():
    columns = tuple(Column(key, key, better="lower") for key in "abc")
    made = Table("t", "T", "C", columns, (({"a": 3.0, "b": 1.0, "c": 2.0},),), across=True)
    assert marks(made) == [["", "best", "second"]]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (math.nan, "–"),
        (math.inf, "∞"),
        (-math.inf, "−∞"),
        (0.0, "0.00"),
        (0.004, "<0.01"),
        (-1.5, "−1.50"),
        (1234.5, "1,234.50"),
        (2.5e7, "2.5·10^7"),
        ("failed", "failed"),
    ],
)
def test_printed_values(value, text):
    assert COLUMNS[1].shown(value) == text


def test_a_fraction_is_shown_as_per_cent():
    assert COLUMNS[2].shown(0.1234) == "12.3"


def test_latex_escapes_everything_that_latex_reads():
    assert latex_text("a_b & 50% #1 {x} ~^\\ $") == (
        r"a\_b \& 50\% \#1 \{x\} \textasciitilde{}\textasciicircum{}\textbackslash{} \$"
    )
    assert latex_text("2.5·10^7") == r"2.5$\cdot 10^{7}$"
    assert latex_text("1.0·10^−3 ∞ ↓") == r"1.0$\cdot 10^{-3}$ $\infty$ $\downarrow$"
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
    assert lines[0] == "| Name | G: A ↓ | G: B ↑ | C |"
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


def test_conformality_keeps_published_figures_apart(results):
    made = conformality(contents(results)[0])
    by_case = {row["case"]: row for row in made.blocks[0]}
    assert by_case[HAND]["published SLIM"] == 0.609
    assert by_case[HAND]["published ParaPoint"] == 0.182
    assert by_case[DEVIL]["claim"] == "stand-in"
    assert by_case[NEFERTITI]["SLIM symmetric Dirichlet"] == "skipped"
    groups = {column.group for column in made.columns if column.key.startswith("published")}
    assert groups == {"Published, other files"}
    assert all(not c.better for c in made.columns if c.key.startswith("published"))
    assert by_case[HAND]["SLIM conformal"] < by_case[HAND]["SLIM symmetric Dirichlet"]


def test_the_supplement_names_energy_iterations_cut_and_verdict(results):
    made = supplement(contents(results)[0])
    rows = {(row["case"], row["method"]): row for block in made.blocks for row in block}
    hand = rows[f"{HAND} (likely)", "SLIM (symmetric Dirichlet, 20 iterations)"]
    assert hand["verdict"] == "lower (better)"
    assert hand["done"] == "1/1"
    assert hand["chart_count"] == 1
    devil = rows[f"{DEVIL} (stand-in)", "SLIM (symmetric Dirichlet, 20 iterations)"]
    assert devil["verdict"] == "none: stand-in"
    assert rows[f"{HAND} (likely)", "SLIM (conformal, 20 iterations)"]["verdict"] == ""
    learned = rows[f"{NEFERTITI} (likely)", "ParaPoint (paper) + automatic cut"]
    assert learned["spanning_fraction"] > 0
    skipped = rows[f"{NEFERTITI} (likely)", "SLIM (symmetric Dirichlet, 20 iterations)"]
    assert skipped["done"] == "skipped"
    assert any("0123456789ab" in note and "Seeds: 0, 3" in note for note in made.notes)


def test_comparison_counts_and_common_means(results):
    suite = contents(results)[0]
    made = comparison(suite, ["angle_difference_mean"])
    rows = {row["method"]: row for row in made.blocks[0]}
    slim, ours = rows["SLIM symmetric Dirichlet"], rows["ParaPoint"]
    assert slim["count"] == "2/2"
    assert slim["skipped"] == 1
    assert ours["count"] == "3/3"
    values = suite.means[suite.means["label"] == "ParaPoint"]["angle_difference_mean"]
    assert ours["mean"] == pytest.approx(values.mean())
    assert ours["worst"] == values.max()
    # All methods that ever succeed do so on the two sheets.
    assert ours["common"] == pytest.approx(values.iloc[:2].mean())
    assert rows[HOSTILE]["mean"] is None
    assert f"2: {HAND}, {DEVIL}" in made.caption


def test_failures_are_told_with_status_and_reason(results):
    made = failures(contents(results)[0])
    told = {row["status"]: row["reason"] for row in made.blocks[0]}
    assert told == {"skipped": f"needs a disk {HOSTILE}", "timeout": "over 10 s"}
