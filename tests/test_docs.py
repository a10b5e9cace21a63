"""What the documentation names exists: files, folders, modules, and the folders of analysis/."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OTHER_PAGES = ("README.md", "CHANGELOG.md", "Makefile", "systemd/README.md", "firmware/esc_counter/README.md",
               "tests/data/README.md")  # fmt: skip
PAGES = [*(ROOT / name for name in OTHER_PAGES), *sorted((ROOT / "docs").glob("*.md"))]
PACKAGES = ("analysis", "daq", "flight", "flightpower", "hw_fakes", "sim")
FOLDERS = (*PACKAGES, "benchmarks", "docs", "systemd", "tests")
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
    package, *rest = dotted.split(".")
    place = ROOT / package
    while rest and (place / rest[0]).is_dir():
        place /= rest.pop(0)
    if rest and (place / f"{rest[0]}.py").exists():
        place = place / f"{rest.pop(0)}.py"
    if not rest:
        return True
    source = place if place.suffix else place / "__init__.py"
    return source.exists() and bool(re.search(rf"\b{rest[0]}\b", source.read_text("utf-8")))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_paths_in_the_documentation_exist(page: Path) -> None:
    assert sorted(named for named in paths_named(page) if not exists(named, page)) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_modules_in_the_documentation_exist(page: Path) -> None:
    """Programs in Python are run by tests of their own."""
    text = PROGRAM.sub("", page.read_text("utf-8"))
    named = {name for name in MODULE.findall(text) if not name.endswith(".py")}
    assert sorted(name for name in named if not module_exists(name)) == []


def test_readme_links_every_page() -> None:
    links = set(LINK.findall((ROOT / "README.md").read_text("utf-8")))
    assert {f"docs/{page.name}" for page in (ROOT / "docs").glob("*.md")} <= links


def test_architecture_lists_the_folders_and_files_of_analysis() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    section = text.split("## The folders of `analysis/`")[1].split("\n## ")[0]
    listed = re.findall(r"^\| `([^`]+)` \|", section, flags=re.MULTILINE)
    folders = {f"{path.name}/" for path in (ROOT / "analysis").iterdir() if (path / "__init__.py").exists()}
    files = {path.name for path in (ROOT / "analysis").glob("*.py")} - {"__init__.py"}
    assert sorted(listed) == sorted(folders | files)


def test_a_folder_of_analysis_imports_only_folders_below_it_in_the_table() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text("utf-8")
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
