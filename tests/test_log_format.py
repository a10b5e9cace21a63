"""log-format.md has every topic, field, status, attachment and metadata name of the code, and no other."""

import re
from pathlib import Path

import msgspec
import pytest

from flightpower.analysis.sources.daemon import COLUMNS
from flightpower.daq.attachments import Attachments, write_attachments
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.messages import SECOND_TOPICS, TOPICS_FOR_DRAG, TYPE_OF_TOPIC, Status

PAGE = (Path(__file__).parent.parent / "docs" / "understand" / "log-format.md").read_text("utf-8")


def section(title: str) -> str:
    """The text from a heading to the next one of the same level or above."""
    level, _, _ = title.partition(" ")
    return re.split(rf"^#{{2,{len(level)}}} ", PAGE.split(f"\n{title}\n")[1], maxsplit=1, flags=re.MULTILINE)[0]


def rows(text: str) -> list[tuple[list[str], str]]:
    """The names in the first cell, and the last cell, of those table rows that begin with code."""
    table = [line.strip("|").split("|") for line in text.splitlines() if re.match(r"\| (\*\*)?`", line)]
    return [(re.findall("(?:[*]{2})?`.*?`", row[0]), row[-1].strip()) for row in table]


def names(text: str) -> list[str]:
    return [name.strip("*`") for row, _ in rows(text) for name in row]


HEADINGS = re.findall(r"^### (`/.*`)$", PAGE, flags=re.MULTILINE)
SECTIONS = {topic: section(f"### {heading}") for heading in HEADINGS for topic in re.findall("`(.*?)`", heading)}


def test_the_page_has_every_topic() -> None:
    assert set(SECTIONS) == set(TYPE_OF_TOPIC) - SECOND_TOPICS


@pytest.mark.parametrize("topic", sorted(set(TYPE_OF_TOPIC) - SECOND_TOPICS))
def test_a_topic_has_its_fields(topic: str) -> None:
    fields = {field.name: field for field in msgspec.structs.fields(TYPE_OF_TOPIC[topic]) if field.name != "status"}
    assert sorted(names(SECTIONS[topic])) == sorted(fields)
    for cell, meaning in rows(SECTIONS[topic]):
        for name in cell:
            if fields[name.strip("*`")].type == (int | None) and "counts" not in name:
                assert meaning.startswith("integer"), name


@pytest.mark.parametrize("topic", TOPICS_FOR_DRAG)
def test_required_fields_are_bold(topic: str) -> None:
    bold = {name.strip("*`") for row, _ in rows(SECTIONS[topic]) for name in row if name.startswith("**")}
    assert bold == {field for of, field in COLUMNS.values() if of == topic}


def test_the_table_of_methods_begins_with_the_required_topics() -> None:
    first = next(line for line in section("## What each method needs").splitlines() if line.startswith("| every"))
    assert re.findall("`(.*?)`", first) == list(TOPICS_FOR_DRAG)
    assert set(re.findall("`(/[a-z/]+)`", section("## What each method needs"))) == set(TYPE_OF_TOPIC) - SECOND_TOPICS


def test_statuses_are_those_of_the_messages() -> None:
    assert names(section("## The file")) == list(Status)


class Recorded:
    """Takes the names that are recorded, in place of a log."""

    def __init__(self) -> None:
        self.attachments: list[str] = []
        self.metadata: dict[str, str] = {}

    def attach(self, name: str, *_: object) -> None:
        self.attachments.append(name)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        assert name == "flightpower"
        self.metadata = values


def test_attachments_and_metadata_are_those_of_the_daemon() -> None:
    log = Recorded()
    attachments = Attachments("", load_aircraft("nexstar"), "", "", "", "", "")
    write_attachments(log, attachments, rate_Hz=25, start_unix_ns=0, start_monotonic_ns=0)  # type: ignore[arg-type]
    assert sorted(names(section("## Attachments and metadata"))) == sorted([*log.attachments, *log.metadata])
