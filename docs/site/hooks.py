"""What MkDocs adds to the pages of docs/: the README as start page, pages of other folders, and pages generated from
the code.

Links of pages that leave docs/ are those of the repository; here they lead to the pages added.
"""

import re
from pathlib import Path
from typing import Any

import assumptions
import troubles
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from flightpower.flight.aircraft_keys import to_markdown

ROOT = Path(__file__).parents[2]
ADDED = (
    "systemd/README.md", "firmware/esc_counter/README.md", "CHANGELOG.md", "LICENSE", "CONTRIBUTING.md", "SECURITY.md",
    "CODE_OF_CONDUCT.md",
)  # fmt: skip
REFERENCE = {
    "From Python": "flightpower.interface",
    "The results": "flightpower.analysis.records.flight",
    "Trust": "flightpower.analysis.results.evidence",
    "Reading a log": "flightpower.flight.log_reader",
    "Messages of a log": "flightpower.flight.messages",
    "Aircraft file": "flightpower.flight.aircraft",
    "Errors": "flightpower.flight.errors",
}
KEYS = f"""\
# Keys of the aircraft file

`SURFACE` stands for `elevator`, `aileron` and `rudder`, `LINE` for `alpha`, `beta`, `airspeed` and `static`; the part
before the dot is the section in brackets. `flightpower new aircraft` writes the same into a file to fill in.

{to_markdown()}"""
LINK = re.compile(r"\]\(([^)\s#]+)(#[^)\s]*)?\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the start page, the pages of other folders and the reference."""
    texts = {"index.md": (ROOT / "README.md").read_text("utf-8")}
    texts |= {
        "reference.md": _reference(),
        "understand/assumptions.md": assumptions.page(),
        "use/aircraft-keys.md": KEYS,
        "use/troubles.md": troubles.page(),
    }
    texts |= {_page(name): (ROOT / name).read_text("utf-8") for name in ADDED}
    for name, text in texts.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: Any, files: Files) -> str:
    """Links within the repository, as links within the site."""
    own = {_page(name): ROOT / name for name in ADDED} | {"index.md": ROOT / "README.md"}
    source = own.get(page.file.src_uri, ROOT / "docs" / page.file.src_uri)
    depth = "../" * page.file.src_uri.count("/")

    def in_site(link: re.Match[str]) -> str:
        target, part = link[1], link[2] or ""
        if "://" in target:
            return link[0]
        path = (source.parent / target).resolve()
        if path.is_dir():
            path /= "README.md"
        if not path.is_relative_to(ROOT):
            return link[0]
        name = path.relative_to(ROOT).as_posix()
        if name in ADDED:
            return f"]({depth}{_page(name)}{part})"
        if name == "README.md":
            return f"]({depth}index.md{part})"
        return f"]({depth}{name.removeprefix('docs/')}{part})"

    return LINK.sub(in_site, markdown)


def _page(name: str) -> str:
    """The name in the site of a page of another folder."""
    return name.replace("/README.md", "").replace("/", "-").lower().removesuffix(".md") + ".md"


def _reference() -> str:
    sections = [f"## {title}\n\n::: {module}\n" for title, module in REFERENCE.items()]
    return "# Reference\n\nGenerated from the code.\n\n" + "\n".join(sections)
