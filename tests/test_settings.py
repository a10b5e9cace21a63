"""Every threshold and prior has its unit and the reason for its value; few numbers are anything else."""

import dataclasses
import importlib.util
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "docs" / "site" / "assumptions.py"
spec = importlib.util.spec_from_file_location("assumptions", SOURCE)
assert spec and spec.loader
assumptions = importlib.util.module_from_spec(spec)
sys.modules["assumptions"] = assumptions
spec.loader.exec_module(assumptions)

MOST = 352  # settings of `analysis`, and other numbers at the top of its modules; add none without need


@pytest.mark.parametrize("record", assumptions.records(), ids=lambda record: f"{record.path} {record.name}")
def test_each_setting_has_a_unit_and_a_reason(record) -> None:
    assert dataclasses.is_dataclass(record.settings)
    assert type(record.settings).__dataclass_params__.frozen, "a setting is not changed while an analysis runs"
    for item in record.settings.described():
        assert item.unit, item.name
        assert len(item.reason.split()) > 1, item.name


def test_settings_and_other_numbers_stay_few() -> None:
    settings, numbers = assumptions.settings_by_folder(), assumptions.remaining_numbers()
    assert settings.total() + numbers.total() <= MOST, {**settings, "other numbers": dict(numbers)}


def test_the_page_of_assumed_values_has_every_setting() -> None:
    rows = {line.split("`")[1] for line in assumptions.page().splitlines() if line.startswith("| `")}
    assert rows == {item.name for record in assumptions.records() for item in record.settings.described()}
