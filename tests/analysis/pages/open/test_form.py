"""The form describes exactly the keys that the analysis uses, and typed values become an aircraft file."""

import tomllib

import pytest

from flightpower.analysis.options import Options
from flightpower.analysis.pages.open.form import AIRCRAFT, OPTIONS, PROPELLER, as_toml, option_values, typed
from flightpower.analysis.pages.open.request import FieldError
from flightpower.flight.aircraft_keys import ALL, KEYS

USES = ("analysis", "cross-check", "power train", "endurance", "report", "pooling of flights", ALL)


def test_every_key_that_the_analysis_uses_has_words_and_no_other_is_shown() -> None:
    shown = {key for fields in AIRCRAFT.values() for key in fields}
    used = {key for key, entry in KEYS.items() if entry.needed_by.startswith(USES)}
    assert shown - {PROPELLER} == used - {"propulsion.propeller"}, "the propeller is a choice of tables"
    words = [label for fields in AIRCRAFT.values() for label in fields.values()]
    assert not any("_" in label for label in words)
    assert [*next(iter(AIRCRAFT.values()))][:3] == ["mass.weight", PROPELLER, "propulsion.battery_energy"]


@pytest.mark.parametrize(
    ("key", "text", "value"),
    [
        ("imu_position", "1 cm, 0 m, -0.5 in", ["1 cm", "0 m", "-0.5 in"]),
        ("probe.position", "0,45 m; 0 m; 0 m", ["0,45 m", "0 m", "0 m"]),
        ("imu_position", '["1 cm", "0 m", "0 m"]', ["1 cm", "0 m", "0 m"]),
        ("title", "a, b", "a, b"),
        ("propulsion.motor_kv_rpm_per_volt", "560", 560),
        ("mass.weight", "4 kg", "4 kg"),
        ("mass.weight", '4"]] = 3', '4"]] = 3'),
        ("propulsion.beyond_zero_thrust", "fold", "fold"),
    ],
)
def test_what_is_typed_becomes_text_number_or_list(key: str, text: str, value: object) -> None:
    assert tomllib.loads(f"value = {as_toml(key, text)}") == {"value": value}


def test_lists_are_read_without_quotation_marks() -> None:
    assert typed(["0.05 m", "0.0 m", "0.02 m"]) == "0.05 m, 0.0 m, 0.02 m" and typed([1, 2.5]) == "1, 2.5"
    assert typed(True) == "true" and typed(7) == "7" and typed("4 kg") == "4 kg"
    listed = [1000, 1500.5]
    assert tomllib.loads(f"value = {as_toml('imu_position', typed(listed))}")["value"] == listed


def test_the_options_are_read_as_the_command_reads_them() -> None:
    for key, option in OPTIONS.items():
        values = option_values({key: option.example})
        assert set(values) == {option.field} and getattr(Options(**values), option.field) == values[option.field]
        assert option.unit == option.example.split()[-1]
    assert option_values({"span": " "}) == {}
    assert option_values({"mass": "21 lb"})["mass_kg"] == pytest.approx(9.5254, abs=1e-3)
    with pytest.raises(FieldError, match="--wing-area"):
        option_values({"mass": "3 kg", "wing-area": "none"})
