"""docs/assumptions.md gives the numbers that the code has: priors, limits and windows on which results depend."""

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "assumptions.md"
ROOM = re.compile(r"## .*: `([\w/]+)/`")  # a folder of analysis, or of the repository
MODULES = sorted(path for package in ("analysis", "daq", "flight") for path in (ROOT / package).rglob("*.py"))
ROW = re.compile(r"\| `(\w+)\.([\w.]+)` \| `(.+?)` \|")


@cache
def constants(module: Path) -> dict[str, str]:
    """The constants at the top of a module, as text. Those of `A, B = 1.0, 2.0` are two; defaults are `Class.field`."""
    return constants_of(ast.parse(module.read_text("utf-8")).body)


def constants_of(body: list[ast.stmt]) -> dict[str, str]:
    found = {}
    for node in body:
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{name}": value for name, value in constants_of(node.body).items()}
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        target, value = node.targets[0] if isinstance(node, ast.Assign) else node.target, node.value
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            found |= {ast.unparse(name): ast.unparse(one) for name, one in zip(target.elts, value.elts, strict=True)}
        else:
            found[ast.unparse(target)] = ast.unparse(value)
    return found


def test_the_page_of_assumed_values_gives_those_of_the_code() -> None:
    room, rows, different = "", 0, []
    for line in PAGE.read_text("utf-8").splitlines():
        if heading := ROOM.match(line):
            room = heading[1]
        elif row := ROW.match(line):
            module, name, told = row.groups()
            rows += 1
            path = (ROOT if room.startswith(("daq", "flight")) else ROOT / "analysis") / room / f"{module}.py"
            used = constants(path).get(name) if path.exists() else None
            if used is None:  # moved: any module that has it
                used = next((of[name] for of in map(constants, MODULES) if of.get(name) == told), None)
            if used != told:
                different.append(f"{room}/{module}.{name}: the page has {told}, the code {used}")
    assert not different, "results depend on these: change both, and say so in CHANGELOG.md"
    assert rows > 400
