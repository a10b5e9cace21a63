"""The documents describe the format of the results as it is in the code."""

from pathlib import Path

import msgspec

from flightpower.analysis.records.flight import Results, schema

DOCS = Path(__file__).parents[2] / "docs"


def test_the_schema_in_the_docs_is_the_code_s() -> None:
    assert (DOCS / "results.schema.json").read_bytes() == schema(), "run: python -m flightpower.analysis.records.flight"


def test_every_field_is_explained() -> None:
    text = (DOCS / "use" / "results.md").read_text("utf-8")
    for field in msgspec.structs.fields(Results):
        assert f"`{field.encode_name}`" in text, field.encode_name
