"""Mutation testing: make small wrong changes, one at a time, and count those that a test notices.

The operators are Cosmic Ray's. A sample of lines, the same for the same seed and equally many from
each package, is changed in a copy of the checkout. The tests that mirror the changed module run
first (or, where none do, those that import it), then the others of its room, then the others of its
package, until one fails.
Exit status: 0, or 1 if less than 85 % are noticed, or 2 if the unchanged code fails.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import parso
from cosmic_ray.ast import ast_nodes
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

ROOT = Path(__file__).parents[2]
PACKAGES = ("parapoint", "baselines", "benchmarks", "reports")
LEAST_SHARE = 0.85
"""The share of the mutants that the tests must notice."""
PATIENCE = 3.0
"""A mutant whose tests take this many times as long as without it, and a minute, is noticed."""
NOTHING_LEFT = 5
"""Exit status of pytest where all tests of a room were nearer and ran before."""
FAMILIES = {
    "arithmetic": [
        f"ReplaceBinaryOperator_{pair}"
        for pair in ("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Pow_Mul", "FloorDiv_Mul")
    ],
    "comparison": [
        f"ReplaceComparisonOperator_{pair}"
        for pair in (
            *("Eq_NotEq", "NotEq_Eq", "Is_IsNot", "IsNot_Is", "Lt_LtE", "LtE_Lt", "Gt_GtE"),
            *("GtE_Gt", "Lt_GtE", "GtE_Lt", "Gt_LtE", "LtE_Gt"),
        )
    ],
    "logic": ["AddNot", "ReplaceAndWithOr", "ReplaceOrWithAnd", "ReplaceUnaryOperator_Delete_Not"],
    "bits": ["ReplaceBinaryOperator_BitAnd_BitOr", "ReplaceBinaryOperator_BitOr_BitAnd"],
    "sign": ["ReplaceUnaryOperator_Delete_USub"],
    "constant": ["NumberReplacer", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue"],
    "flow": ["ZeroIterationForLoop", "ReplaceBreakWithContinue", "ReplaceContinueWithBreak"],
}
"""Cosmic Ray's operators by kind. All kinds that fit a line are equally likely."""
TALK = frozenset({"print", "echo", "secho", "debug", "info", "warning", "fail", "InputError"})
"""Functions whose arguments are words for a reader."""

LOOKS = frozenset(
    {"digits", "figsize", "fontsize", "linewidth", "markersize", "zorder", "copy", "strict"}
)
"""Keywords whose values are not changed: the looks of tables and figures, `copy=`, `strict=`."""
DRAWS = frozenset({"default_rng", "manual_seed", "Random"})
"""Functions whose arguments are seeds: another is as good."""
ABOUT = 10
"""A limit that a constant names, of at least so much, might be one more or less as well."""
DANGEROUS = Path("benchmarks", "checks", "hardships.py")
"""A file that is not changed: it kills what is left of a check, and a change might kill others."""

Position = tuple[int, int]
"""Line, from 1, and column, from 0."""


def ignored(source: str) -> list[tuple[Position, Position]]:
    """Where no mutant is made: type hints, decorators, messages, imports, and so on."""
    lines = source.splitlines()

    def span(node: ast.AST) -> tuple[Position, Position]:
        def at(line: int, column: int) -> Position:  # ast counts bytes, parso characters
            return line, len(lines[line - 1].encode()[:column].decode())

        return at(node.lineno, node.col_offset), at(node.end_lineno, node.end_col_offset)

    tree = ast.parse(source)
    found: list[ast.AST] = []
    for statement in tree.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign):
            found += [node for node in ast.walk(statement) if is_about(node)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr | ast.Import | ast.ImportFrom):
            found.append(node)
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            found += [node] if name in TALK else []
            found += [key for key in node.keywords if key.arg in LOOKS]
            rest = [one for of in node.args for one in ast.walk(of) if is_rest(one)]
            found += rest if name == "reshape" else []
            found += node.args[1:] if name == "round" else []
            found += node.args if name in DRAWS else []
        elif isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            found.append(node)
        elif isinstance(node, ast.arg | ast.AnnAssign):
            found += [node.annotation] if node.annotation else []
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            found += [*node.decorator_list, getattr(node, "returns", None) or ast.Pass()]
    return [span(node) for node in found if hasattr(node, "lineno")]


def is_about(node: ast.AST) -> bool:
    """Whether a node is a whole number of ABOUT or more, 1e9 as well as 50."""
    if not isinstance(node, ast.Constant) or type(node.value) not in {int, float}:
        return False
    return node.value >= ABOUT and float(node.value).is_integer()


def is_rest(node: ast.AST) -> bool:
    """Whether a node is -1, as of `reshape`, for which any other negative number would do."""
    return isinstance(node, ast.UnaryOp) and ast.unparse(node) == "-1"


def is_star(node: parso.tree.NodeOrLeaf) -> bool:
    """Whether a node is the star or slash of a signature or call, which multiplies nothing."""
    parent = node.parent.type if node.parent else ""
    return node.type == "operator" and parent in {"parameters", "param", "argument", "star_expr"}


def mutants(source: str) -> dict[int, dict[str, list[tuple[str, int]]]]:
    """The possible mutants by line and family: each an operator and its occurrence."""
    nodes = list(ast_nodes(parso.parse(source)))
    quiet = ignored(source)
    found: dict[int, dict[str, list[tuple[str, int]]]] = {}
    for family, names in FAMILIES.items():
        for name in names:
            operator = get_operator(f"core/{name}")()
            places = ((node, at) for node in nodes for at, _ in operator.mutation_positions(node))
            for occurrence, (node, start) in enumerate(places):
                if not is_star(node) and not any(first <= start < last for first, last in quiet):
                    line = found.setdefault(start[0], {})
                    line.setdefault(family, []).append((name, occurrence))
    return found


def sample(chance: random.Random, package: str) -> Iterator[tuple[Path, int, str, str]]:
    """Mutants of a package without end: the file, line, operator, and the source changed by it."""
    files = sorted(set((ROOT / package).rglob("*.py")) - {ROOT / DANGEROUS})
    sizes = [path.read_text(encoding="utf-8").count("\n") for path in files]
    while True:
        (path,) = chance.choices(files, sizes)
        source = path.read_text(encoding="utf-8")
        if not (found := mutants(source)):
            continue
        line = chance.choice(sorted(found))
        name, occurrence = chance.choice(found[line][chance.choice(sorted(found[line]))])
        changed = mutate_code(source, get_operator(f"core/{name}")(), occurrence)
        if changed is not None and is_another(changed, source):
            yield path.relative_to(ROOT), line, name, changed


def is_another(changed: str, source: str) -> bool:
    """Whether a changed source is Python still (`not a := b` is not) and another program."""
    try:
        return ast.dump(ast.parse(changed)) != ast.dump(ast.parse(source))
    except SyntaxError:
        return False


def stages(copy: Path, module: Path) -> list[list[str]]:
    """What pytest is to run for a module, the nearest tests first, nothing twice."""
    mirror = Path("tests", module.parent, f"test_{module.stem}.py")
    nearest = [mirror] if (copy / mirror).exists() else importing(copy, module)
    wider = dict.fromkeys((mirror.parent, Path("tests", module.parts[0])))
    found, done = [[str(path) for path in nearest]] if nearest else [], nearest
    for room in wider:
        if (copy / room).exists():
            found.append([str(room), *(f"--ignore={path}" for path in done)])
            done = [*done, room]
    return found


def importing(copy: Path, module: Path) -> list[Path]:
    """The tests of a module's package that import it by name."""
    parent, name = ".".join(module.parent.parts), module.stem
    wanted = re.compile(rf"{parent}\.{name}\b|from {parent} import [^\n]*\b{name}\b")
    tests = sorted((copy / "tests" / module.parts[0]).rglob("test_*.py"))
    found = [test for test in tests if wanted.search(test.read_text(encoding="utf-8"))]
    return [test.relative_to(copy) for test in found]


def passes(copy: Path, tests: list[str], limit: float | None, *, printed: bool = False) -> bool:
    """Whether the tests pass in the copy within `limit` seconds; `printed` shows a failure."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
    command += [] if tests[0].endswith(".py") else ["-n", "logical", "--dist", "worksteal"]
    environment = os.environ | {
        "PYTHONPATH": str(copy),
        "PYTHONDONTWRITEBYTECODE": "1",  # a stale byte code file would hide the next mutant
        "OMP_NUM_THREADS": "1",
    }
    process = subprocess.Popen(
        command,
        cwd=copy,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        output, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)  # the workers of the tests, too
        process.communicate()
        return False
    if printed and process.returncode:
        print(output[-3000:])
    return process.returncode in {0, NOTHING_LEFT}


def main() -> int:
    """Sample, test, and print what survived."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=60, help="mutants over all packages")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--packages", nargs="+", choices=PACKAGES, default=PACKAGES)
    given = parser.parse_args()
    os.nice(10)
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    files = subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = Path(folder)
        for name in filter(None, files.split("\0")):
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, copy / name)
        noticed, survivors = 0, []
        for package in given.packages:
            began = time.monotonic()
            if not passes(copy, [f"tests/{package}"], None, printed=True):
                print(f"The unchanged code fails tests/{package}: no mutant was tried.")
                return 2
            limit = PATIENCE * (time.monotonic() - began) + 60
            print(f"{package}: the unchanged code passes.", flush=True)
            source = sample(random.Random(f"{given.seed} {package}"), package)  # noqa: S311 - no secret
            for _ in range(given.samples // len(given.packages)):
                path, line, name, changed = next(source)
                before = (copy / path).read_text(encoding="utf-8")
                (copy / path).write_text(changed, encoding="utf-8")
                survived = all(passes(copy, tests, limit) for tests in stages(copy, path))
                (copy / path).write_text(before, encoding="utf-8")
                noticed += not survived
                text = changed.splitlines()[line - 1].strip()
                said = f"{'SURVIVED' if survived else 'noticed '} {path}:{line} {name}: {text}"
                print(said, flush=True)
                survivors += [said] if survived else []
    tried = max(1, noticed + len(survivors))
    print(f"\n{noticed} of {tried} noticed ({noticed / tried:.0%}), seed {given.seed}. Survivors:")
    print("\n".join(survivors) or "none")
    return int(noticed / tried < LEAST_SHARE)


if __name__ == "__main__":
    sys.exit(main())
