"""What the documentation names exists: files, folders, modules, and the folders of analysis/."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.our_files import dotted_path, nodes_of

pytestmark = pytest.mark.xdist_group("sources")

ROOT = Path(__file__).parent.parent
OTHER_PAGES = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "Makefile",
               "systemd/README.md", "firmware/esc_counter/README.md", "tests/data/README.md")  # fmt: skip
PAGES = [*(ROOT / name for name in OTHER_PAGES), *sorted((ROOT / "docs").glob("*/*.md"))]
PACKAGES = ("analysis", "daq", "flight", "flightpower", "hw_fakes", "sim")
OF_CODE = (*PACKAGES, "benchmarks")
FOLDERS = (*OF_CODE, "docs", "systemd", "tests")
SUFFIXES = (".py", ".md", ".toml", ".json", ".csv", ".png", ".svg", ".sh")

OURS = re.compile(rf"(?<![\w/.$-])(?:{'|'.join(FOLDERS)})/[\w./-]*")
MODULE = re.compile(rf"(?<![\w/.-])(?:{'|'.join(PACKAGES)})(?:\.[A-Za-z_]\w*)+(?![\w/-])")
PROGRAM = re.compile(r"^```python\n.*?^```", re.MULTILINE | re.DOTALL)
IN_BACKTICKS = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\]\(([^)\s]+)\)")


def paths_named(page: Path) -> set[str]:
    """Words and link targets of a page that look like paths in the repository, as they are written."""
    text = page.read_text("utf-8")
    named = {path.rstrip(".") for path in OURS.findall(text)}
    named |= {link.split("#")[0] for link in LINK.findall(text) if "://" not in link}
    words = [word.split("::")[0] for quoted in IN_BACKTICKS.findall(text) for word in quoted.split()]
    return named | {word for word in words if re.fullmatch(r"\w[\w-]*/[\w./-]+", word) and word.endswith(SUFFIXES)}


def exists(named: str, page: Path) -> bool:
    """Whether a path exists from the page's folder, the root or analysis/ (architecture.md shortens the latter)."""
    return not named or any((base / named).exists() for base in (page.parent, ROOT, ROOT / "analysis"))


def module_exists(dotted: str) -> bool:
    """Whether a dotted name is a module, or one of its files contains the last name as a word."""
    package, *rest = dotted_path(dotted).split(".")
    place = ROOT / package
    while rest and (place / rest[0]).is_dir():
        place /= rest.pop(0)
    if rest and (place / f"{rest[0]}.py").exists():
        place = place / f"{rest.pop(0)}.py"
    if not rest:
        return True
    source = place if place.suffix else place / "__init__.py"
    return source.exists() and bool(re.search(rf"\b{rest[0]}\b", source.read_text("utf-8")))


# Words of each shelf, 33,000 in all, so that the documentation can be read in an evening.
MOST_WORDS = {
    "README.md": 770,
    "docs/use/*.md": 12_225,
    "docs/understand/*.md": 12_340,
    "docs/evidence/*.md": 6_180,
    "systemd/README.md": 1_240,
    "firmware/*/README.md": 240,
}


@pytest.mark.parametrize(("pages", "most"), MOST_WORDS.items(), ids=str)
def test_a_shelf_has_no_more_words_than_it_may(pages: str, most: int) -> None:
    """A word has a letter: neither the numbers of a table nor the targets of links are words."""
    texts = [LINK.sub("]", page.read_text("utf-8")) for page in ROOT.glob(pages)]
    words = [word for text in texts for word in text.split() if re.search(r"[^\W\d_]", word)]
    assert 0 < len(words) <= most


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_paths_in_the_documentation_exist(page: Path) -> None:
    assert sorted(named for named in paths_named(page) if not exists(named, page)) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_modules_in_the_documentation_exist(page: Path) -> None:
    """Python programs on the pages have tests of their own."""
    text = PROGRAM.sub("", page.read_text("utf-8"))
    named = {name for name in MODULE.findall(text) if not name.endswith(".py")}
    assert sorted(name for name in named if not module_exists(name)) == []


def test_every_page_is_reached_from_the_readme() -> None:
    reached: set[Path] = set()
    new = {ROOT / "README.md"}
    while new:
        reached |= new
        linked = {
            (page.parent / link.split("#")[0]).resolve() for page in new for link in LINK.findall(page.read_text())
        }
        new = {page for page in linked if page.suffix == ".md" and page.is_file()} - reached
    assert {*PAGES} - {ROOT / "Makefile", ROOT / "tests" / "data" / "README.md", *reached} == set()


def test_pages_linked_from_the_readme_are_pages_of_the_site() -> None:
    """Pages outside docs/ are added by a list; `make site` refuses links to other files."""
    hooks = (ROOT / "docs" / "site" / "hooks.py").read_text("utf-8")
    (added,) = re.findall(r"^ADDED = (\([^)]*\))", hooks, flags=re.MULTILINE)
    links = {link.split("#")[0] for link in LINK.findall((ROOT / "README.md").read_text("utf-8"))}
    outside = {link for link in links if "://" not in link and not link.startswith("docs/")}
    assert outside <= set(ast.literal_eval(added))


def test_architecture_lists_the_folders_and_files_of_analysis() -> None:
    text = (ROOT / "docs" / "understand" / "architecture.md").read_text("utf-8")
    section = text.split("## The folders of `analysis/`")[1].split("\n## ")[0]
    listed = re.findall(r"^\| `([^`]+)` \|", section, flags=re.MULTILINE)
    folders = {f"{path.name}/" for path in (ROOT / "analysis").iterdir() if (path / "__init__.py").exists()}
    files = {path.name for path in (ROOT / "analysis").glob("*.py")} - {"__init__.py"}
    assert sorted(listed) == sorted(folders | files)


def test_a_folder_of_analysis_imports_only_folders_below_it_in_the_table() -> None:
    text = (ROOT / "docs" / "understand" / "architecture.md").read_text("utf-8")
    section = text.split("## The folders of `analysis/`")[1].split("\n## ")[0]
    rows = [
        name.rstrip("/").removesuffix(".py") for name in re.findall(r"^\| `([^`]+)` \|", section, flags=re.MULTILINE)
    ]
    upwards = []
    for path in (ROOT / "analysis").rglob("*.py"):
        room = path.relative_to(ROOT / "analysis").parts[0].removesuffix(".py")
        for imported in re.findall(
            r"^ *from analysis[. ](?:import )?(\w+)", path.read_text("utf-8"), flags=re.MULTILINE
        ):
            if room in rows and imported in rows and rows.index(imported) < rows.index(room):
                upwards.append(f"{path.relative_to(ROOT)} imports {imported}")
    assert upwards == []


# Names in backticks in docstrings that are not ours: of a library, a style sheet, JSON Schema, propeller files; a
# column.
OF_OTHERS = {
    "scipy.ndimage",
    "blklogwrites",
    "rgba",
    "anyOf",
    "PER3",
    "apce_10x5_kt0821_5000.txt",
    "alpha_rad_standard_error",
}
NAME = re.compile(r"[A-Za-z_]\w*(?:\.\w+)*(?:\(.*\))?")


class Code(NamedTuple):
    """What the packages define, use, or read from data: names, modules, files, and texts that are one name or path.

    docstrings : those that name code, by package: where, and the text
    """

    names: frozenset[str]
    docstrings: dict[str, list[tuple[str, str]]]


@cache
def the_code() -> Code:
    """All packages, read once."""
    named = {word for package in OF_CODE for path in (ROOT / package).rglob("*") for word in path.stem.split(".")}
    texts: dict[str, list[tuple[str, str]]] = {package: [] for package in OF_CODE}
    for package in OF_CODE:
        tables = [path.read_text("utf-8") for path in (ROOT / package).rglob("*.toml")]
        named |= {word for text in tables for word in re.findall(r"\w+", text)}
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in nodes_of(path):
                named |= set(_names(node))
                if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                    text = ast.get_docstring(node, clean=False) or ""
                    if "`" in text:
                        texts[package].append((f"{path.relative_to(ROOT)} {getattr(node, 'name', '')}", text))
    return Code(frozenset(named | {*PACKAGES}), texts)


def _names(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name) | ast.keyword(arg=str(name)):
            yield name
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            yield name
        case ast.alias(name=name):
            yield from name.split(".")
        case ast.Constant(value=str(text)) if re.fullmatch(r"[\w./-]+", text):
            yield from re.findall(r"\w+", text)


@pytest.mark.slow
@pytest.mark.parametrize("package", OF_CODE)
def test_code_that_a_docstring_names_exists(package: str) -> None:
    missing = [
        f"{where}: `{name}`"
        for where, text in the_code().docstrings[package]
        for name in IN_BACKTICKS.findall(text)
        if NAME.fullmatch(name) and name.split("(")[0] not in OF_OTHERS
        if not all(word in the_code().names for word in name.split("(")[0].split("."))
    ]
    assert missing == []
