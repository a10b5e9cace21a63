"""The airspeed scale found by another flight is removed from the pressure; the prior is that of the remaining error."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.air.airspeed_scale import AIRSPEED_FILE, AirspeedScale
from flightpower.analysis.options import Options
from flightpower.analysis.pipeline import analyze
from flightpower.analysis.sources.open import open_source
from flightpower.flight.errors import InputError
from flightpower.flight.files import sha256_of
from flightpower.flight.units import GRAVITY_MPS2
from tests.analysis.sources.flown_table import AREA_M2, MAP, MASS_KG, SPAN_M, flown_table, map_text, written

SCALE, ERROR = 0.05, 0.004
AIRCRAFT = {"mass_kg": MASS_KG, "wing_area_m2": AREA_M2, "span_m": SPAN_M}
BARE = {name: MAP[name] for name in ("time", "true_airspeed", "height", "battery_voltage", "battery_current")}
GPS = {name: MAP[name] for name in ("velocity_north", "velocity_east", "velocity_down")}


def scale_file(folder: Path, **changed: object) -> Path:
    content = {
        "format": "flightpower-airspeed-1",
        "source": "a.mcap",
        "scale": SCALE,
        "scale_error": ERROR,
        "wind_mps": 3,
    }
    (folder / "airspeed.json").write_text(json.dumps(content | changed))
    return folder / "airspeed.json"


def test_a_reading_that_is_high_by_the_scale_gives_the_airspeed() -> None:
    scale = AirspeedScale(source="a", scale=SCALE, scale_error=ERROR)
    V = np.array([10.0, 20.0])
    read = pd.DataFrame({"q_c_Pa": ((1 + SCALE) * V) ** 2})
    assert np.sqrt(scale.corrected(read)["q_c_Pa"]).to_numpy() == pytest.approx(V)


def test_the_speeds_of_an_energy_balance_are_those_of_the_flight(tmp_path: Path) -> None:
    """A pitot reads 5 % high. Without GPS the slowest speed flown is 5 % high without the calibration, and right with
    it. With GPS the flight shows that no scale error is left, and the prior is the calibration's."""
    high = flown_table().assign(tas_mps=lambda t: (1 + SCALE) * t["tas_mps"])
    calibration = scale_file(tmp_path)

    def slowest_mps(table: pd.DataFrame, columns: dict[str, tuple[str, str]], **options: object) -> float:
        path = written(tmp_path, table, map_text(columns))
        results = analyze(open_source(path), Options(**AIRCRAFT, **options)).results  # type: ignore[arg-type]
        return results.curves[results.kind].points[0].speed_mps

    true_mps = slowest_mps(flown_table(), BARE)
    assert slowest_mps(high, BARE) / true_mps == pytest.approx(1 + SCALE, abs=0.005)
    assert slowest_mps(high, BARE, airspeed=calibration) / true_mps == pytest.approx(1.0, abs=0.005)
    assert slowest_mps(high, BARE | GPS, airspeed=calibration) / true_mps == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"scale": 3.0}, "not an airspeed calibration"),
        ({"scale_error": 0.0}, "not an airspeed calibration"),
        ({"format": "flightpower-probe-2"}, "is not supported"),
    ],
)
def test_a_file_that_is_none_is_refused(changed: dict[str, object], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        AIRSPEED_FILE.load(scale_file(tmp_path, **changed))


def test_the_flight_that_gave_the_scale_is_not_counted_twice(tmp_path: Path) -> None:
    path = written(tmp_path, flown_table(), map_text(BARE))
    with pytest.raises(InputError, match="would count twice; leave --airspeed out"):
        analyze(open_source(path), Options(**AIRCRAFT, airspeed=scale_file(tmp_path, log_sha256=sha256_of(path))))  # type: ignore[arg-type]


def test_a_log_without_airspeed_has_no_use_for_it(tmp_path: Path) -> None:
    without = {name: column for name, column in (BARE | GPS).items() if name != "true_airspeed"}
    path = written(tmp_path, flown_table(), map_text(without))
    with pytest.raises(InputError, match="--airspeed: has no effect, since the log lacks airspeed"):
        analyze(open_source(path), Options(**AIRCRAFT, airspeed=scale_file(tmp_path)))  # type: ignore[arg-type]


def aircraft_file(folder: Path, name: str, installation: str = "") -> Path:
    path = folder / "aircraft.toml"
    named = f'\n[installation]\nname = "{installation}"\n' if installation else ""
    text = f"""name = "{name}"
[geometry]
wing_area = "{AREA_M2} m^2"
span = "{SPAN_M} m"
[mass]
weight = "{MASS_KG * GRAVITY_MPS2} N"
"""
    path.write_text(text + named)
    return path


@pytest.mark.parametrize(
    ("of_file", "installation", "differs"),
    [
        ({}, "may", False),  # a file of an earlier version
        ({"aircraft": "mine"}, "may", False),
        ({"aircraft": "mine", "installation": "may"}, "may", False),
        ({"aircraft": "mine", "installation": "april"}, "", False),
        ({"aircraft": "mine", "installation": "april"}, "may", True),
    ],
)
def test_another_installation_is_noted(
    of_file: dict[str, str], installation: str, differs: bool, tmp_path: Path
) -> None:
    path = written(tmp_path, flown_table(), map_text(BARE))
    options = Options(aircraft=aircraft_file(tmp_path, "mine", installation), airspeed=scale_file(tmp_path, **of_file))
    warnings = analyze(open_source(path), options).results.warnings
    assert any("with the installation april, and this flight has may" in text for text in warnings) == differs


def test_the_scale_of_another_aircraft_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, flown_table(), map_text(BARE))
    options = Options(aircraft=aircraft_file(tmp_path, "mine"), airspeed=scale_file(tmp_path, aircraft="yours"))
    with pytest.raises(InputError, match=r"airspeed.json: .* aircraft yours, .* of mine; leave --airspeed out, or run"):
        analyze(open_source(path), options)
