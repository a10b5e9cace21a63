"""Mutates the code: one operator, bound or number is changed, and the tests should notice.

    python benchmarks/mutations.py --seed 8001 --count 40

A mutation turns + into - and * into /, reverses a comparison, doubles or halves a decimal number, drops a minus, or
puts sin for cos and min for max. The draw is uniform over all such places in `analysis/`, `daq/` and `flight/`; a seed
always gives the same draw of the same code. Each mutation is made in a copy of the tracked files. It counts as killed
when a test fails, or its files take longer than --timeout-s, and the same run passes without the mutation. A mutated
module that cannot be imported tells nothing about the tests: another mutation is drawn in its place. Test files run in
the order of `make near`. A survivor costs the time of the whole suite; `--nearest N` stops after N files. Exit code 1
if fewer than --killed are killed.
"""

import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from tests import near
from tests.our_files import module_of

ROOT = Path(__file__).resolve().parent.parent
PLACES = ("analysis", "daq", "flight")
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}
COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.GtE: ast.Lt,
}
FUNCTIONS = {"sin": "cos", "cos": "sin", "maximum": "minimum", "minimum": "maximum", "min": "max", "max": "min"}


class Mutation(NamedTuple):
    """A change of one expression. file: path relative to the root; text: text of the mutated file"""

    file: Path
    line: int
    before: str
    after: str
    text: str

    def __str__(self) -> str:
        before, after = " ".join(self.before.split()), " ".join(self.after.split())
        return f"{self.file}:{self.line}  {before}  ->  {after}"


def sites(tree: ast.Module) -> list[ast.expr]:
    """Return the expressions that can be mutated, always in the same order. Annotations and f-strings do not count."""
    annotations = {
        id(inner)
        for node in ast.walk(tree)
        for field in ("annotation", "returns")
        if getattr(node, field, None) is not None
        for inner in ast.walk(getattr(node, field))
    }
    return [
        node for node in ast.walk(tree) if id(node) not in annotations and isinstance(node, ast.expr) and is_site(node)
    ]


def is_site(node: ast.expr) -> bool:
    match node:
        case ast.BinOp(left=left, op=op, right=right):
            texts = (ast.JoinedStr, ast.List, ast.Tuple)
            joined = any(isinstance(x, texts) or is_text(x) for x in (left, right))
            return type(op) in OPERATORS and not joined
        case ast.Compare(ops=[op, *_]):
            return type(op) in COMPARISONS
        case ast.Constant(value=float(value)):
            return value != 0.0
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return not isinstance(operand, ast.Constant)
        case ast.Call(func=ast.Attribute(attr=name)):
            return name in FUNCTIONS
    return False


def is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def change(node: ast.expr, rng: random.Random) -> None:
    """Mutate the expression in place."""
    match node:
        case ast.BinOp():
            node.op = OPERATORS[type(node.op)]()
        case ast.Compare():
            node.ops[0] = COMPARISONS[type(node.ops[0])]()
        case ast.Constant(value=float(value)):
            node.value = value * rng.choice((2.0, 0.5))
        case ast.UnaryOp():
            node.op = ast.UAdd()
        case ast.Call(func=ast.Attribute() as function):
            function.attr = FUNCTIONS[function.attr]


def mutation(file: Path, index: int, rng: random.Random) -> Mutation | None:
    """Mutate the expression with this index in a file. None if the text cannot be changed at exactly one place."""
    source = (ROOT / file).read_text("utf-8")
    tree = ast.parse(source)
    node = sites(tree)[index]
    before = ast.get_source_segment(source, node) or ""
    lines = source.encode().splitlines(keepends=True)
    start = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    end = sum(map(len, lines[: (node.end_lineno or 0) - 1])) + (node.end_col_offset or 0)
    change(node, rng)
    after = f"({ast.unparse(node)})"
    text = (source.encode()[:start] + after.encode() + source.encode()[end:]).decode()
    try:  # inside an f-string, Python 3.11 gives wrong places for some expressions
        right = ast.dump(ast.parse(text)) == ast.dump(ast.parse(ast.unparse(tree)))
    except SyntaxError:
        right = False
    return Mutation(file, node.lineno, before, after, text) if right else None


def random_mutations(seed: int) -> Iterator[Mutation]:
    """Yield random mutations, drawn without replacement from all places."""
    rng = random.Random(seed)
    files = sorted(p.relative_to(ROOT) for place in PLACES for p in (ROOT / place).rglob("*.py"))
    pool = [(f, i) for f in files for i in range(len(sites(ast.parse((ROOT / f).read_text("utf-8")))))]
    rng.shuffle(pool)
    for file, index in pool:
        made = mutation(file, index, rng)
        if made is not None:
            yield made


@cache
def import_graph() -> dict[Path, set[Path]]:
    """Return which file imports which; this is found once for all mutations."""
    return near.imports(ROOT)


def tests_by_distance(file: Path) -> list[Path]:
    """Return all test files: first the nearest by imports, as in `make near`, then files without an import path."""
    nearest = near.nearest(file, import_graph(), [file], sys.maxsize)
    return nearest + sorted({p.relative_to(ROOT) for p in (ROOT / "tests").rglob("test_*.py")} - {*nearest})


def environment_of(copy: Path) -> dict[str, str]:
    others = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return others | {"PYTHONPATH": str(copy), "OPENBLAS_NUM_THREADS": "1"}


def run(copy: Path, arguments: list[str], timeout_s: float) -> subprocess.CompletedProcess[str] | None:
    """Run Python in the copy. Returns None after the timeout."""
    environment = environment_of(copy) | {"PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, *arguments]
    try:
        return subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, timeout=timeout_s)
    except subprocess.TimeoutExpired:
        return None


def compile_copy(copy: Path) -> None:
    """Compile modules and tests once; a mutated file's size and time differ, so that Python recompiles it."""
    command = [sys.executable, "-m", "pytest", "-q", "--collect-only", "-p", "no:cacheprovider"]
    subprocess.run(command, cwd=copy, env=environment_of(copy), capture_output=True)


def failure(copy: Path, tests: list[str], timeout_s: float) -> str | None:
    """Return the first test that fails, "timeout", or None if all pass."""
    done = run(copy, ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests], timeout_s)
    if done is None:
        return "timeout"
    if done.returncode in (0, 5):  # 5 means no test in these files
        return None
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0].split(" - ")[0].split(maxsplit=1)[1] if failed else f"exit code {done.returncode}"


def can_be_imported(made: Mutation, copy: Path) -> bool:
    (copy / made.file).write_text(made.text, "utf-8")
    try:
        module = module_of(".".join(made.file.with_suffix("").parts).removesuffix(".__init__"))
        done = run(copy, ["-c", f"import {module}"], 60.0)
        return done is not None and done.returncode == 0
    finally:
        shutil.copyfile(ROOT / made.file, copy / made.file)


def killer(made: Mutation, copy: Path, tests: list[Path], timeout_s: float) -> str | None:
    """Run the tests against a mutation, eight files at a time. Returns the first test that fails; None if it survives.

    A test that fails even without the mutation proves nothing: its file is left out.
    """
    left = [str(test) for test in tests]
    while left:
        batch = left[:8]
        (copy / made.file).write_text(made.text, "utf-8")
        try:
            failed = failure(copy, batch, timeout_s)
        finally:
            shutil.copyfile(ROOT / made.file, copy / made.file)
        if failed is None:
            left = left[8:]
            continue
        file = failed.split("::")[0]
        if failure(copy, [failed] if file in batch else batch, timeout_s) is None:
            return failed
        left = [test for test in left if test != file] if file in batch else left[8:]
    return None


def main(
    seed: Annotated[int, typer.Option(help="of the draw")] = 8001,
    count: Annotated[int, typer.Option(help="mutations to draw")] = 40,
    killed: Annotated[int, typer.Option(help="how many the tests must kill for exit code 0")] = 36,
    nearest: Annotated[int, typer.Option(help="test files for each mutation; 0: all")] = 0,
    timeout_s: Annotated[float, typer.Option(help="for a run of eight test files")] = 600.0,
    dry_run: Annotated[bool, typer.Option("--list", help="only print the draw")] = False,
) -> None:
    """Draw mutations, run the tests against each, and print a line for each and the total."""
    draw = random_mutations(seed)
    if dry_run:
        print("\n".join(map(str, islice(draw, count))))
        return
    noticed = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for name in tracked.splitlines():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, copy / name, follow_symlinks=False)
        compile_copy(copy)
        for made in islice((m for m in draw if can_be_imported(m, copy)), count):
            begin = time.monotonic()
            test = killer(made, copy, tests_by_distance(made.file)[: nearest or None], timeout_s)
            noticed += test is not None
            print(
                f"{'killed' if test else 'SURVIVED':8} {made}  [{test or ''}] {time.monotonic() - begin:.0f} s",
                flush=True,
            )
    print(f"{noticed} of {count} killed")
    if noticed < killed:
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
