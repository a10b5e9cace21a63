"""The printed summary of a calibration: 95 % intervals in the stated units."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.air.magnetometer import MagnetometerCalibration
from flightpower.analysis.air.transducers import TransducerCalibration, TransducerLine
from flightpower.analysis.calibrations.airspeed import autopilot_airspeed
from flightpower.analysis.calibrations.airspeed import summary as of_airspeed
from flightpower.analysis.calibrations.magnetometer import summary as of_magnetometer
from flightpower.analysis.calibrations.surfaces import _angle_deg
from flightpower.analysis.calibrations.transducers import pressures_Pa
from flightpower.analysis.calibrations.transducers import summary as of_transducers
from flightpower.analysis.calibrations.weight_and_balance import WeightAndBalance, support
from flightpower.analysis.calibrations.weight_and_balance import summary as of_weight
from flightpower.analysis.methods.whole_flight.airspeed_gps import AirspeedErrors
from flightpower.analysis.sources.recognize import Autopilot
from flightpower.analysis.sources.recording import GPS
from flightpower.analysis.trajectory.consistency import AirspeedCalibration
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2


@pytest.mark.parametrize(("scale", "side"), [(0.021, "high"), (-0.021, "low")])
def test_the_airspeed_s_scale_and_the_wind(scale: float, side: str) -> None:
    calibration = AirspeedCalibration(scale, 0.005, 4.26, 301.4, 0.2, ["of the scale"], "")
    assert of_airspeed(calibration, ["of the log"]) == [
        f"airspeed reads 2.10 ± 0.98 % too {side} (95 % interval)",
        "wind 4.3 m/s from 301 deg, mean of the flight",
        "note: of the scale",
        "note: of the log",
    ]


@pytest.mark.parametrize(("directions", "noted"), [(0.24, True), (0.26, False)])
def test_the_magnetometer_s_iron_in_microtesla(directions: float, noted: bool) -> None:
    calibration = MagnetometerCalibration(
        source="", samples=100, hard_iron_T=(1.24e-6, -2.5e-6, 0.0), hard_iron_error_T=(1e-7, 2e-7, 3.1e-7),
        soft_iron=((1, 0, 0), (0, 1, 0), (0, 0, 1)), soft_iron_error=0.012, field_T=48.3e-6, residual_before_T=2.5e-6,
        residual_T=0.31e-6, directions=directions,
    )  # fmt: skip
    lines = of_magnetometer(calibration)
    assert lines[:5] == [
        "hard iron x +1.2 ± 0.1 uT",
        "hard iron y -2.5 ± 0.2 uT",
        "hard iron z +0.0 ± 0.3 uT",
        "soft iron ± 1.2 %; field 48.3 uT",
        "field strength varies by 2.50 uT rms as measured, 0.31 uT corrected",
    ]
    assert (
        lines[5:] == ["note: all directions lie near one plane; turn the aircraft about another axis, too"]
    ) is noted


def test_the_weight_in_kilograms_and_its_place_in_millimeters() -> None:
    weight_and_balance = WeightAndBalance(4.1, 0.005, 0.1234, 0.001, "")
    assert of_weight(weight_and_balance) == [
        "weight 4.100 ± 0.010 kg (95 % interval)",
        "center of gravity 123.4 ± 2.0 mm aft of the datum",
    ]
    assert "no position" in of_weight(weight_and_balance._replace(position_m=None))[1]


@pytest.mark.parametrize(
    ("text", "position_m", "masses_kg"),
    [("0.12 m: 1.25 1.26 kg", 0.12, (1.25, 1.26)), ("5 in: 900, 910 g", 0.127, (0.9, 0.91)), ("4 kg", None, (4.0,))],
)
def test_a_support_is_its_position_and_its_readings(text: str, position_m: float | None, masses_kg) -> None:
    result = support(text)
    assert result.position_m == pytest.approx(position_m) and tuple(result)[1] == pytest.approx(masses_kg)


@pytest.mark.parametrize("text", ["kg", "0.1 m: kg", ""])
def test_a_support_without_a_reading_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="numbers and their unit are needed"):
        support(text)


@pytest.mark.parametrize(("scale", "side"), [(0.0123, "high"), (-0.0123, "low")])
def test_the_transducers_lines_and_what_they_do_to_the_airspeed(scale: float, side: str) -> None:
    line = TransducerLine(slope=1.021, slope_error=0.002, offset_Pa=-2.34, largest_residual_Pa=0.52, largest_Pa=400.0)
    calibration = TransducerCalibration(
        source="", plateaus=8, reference_error=0.002, alpha=line, beta=line, airspeed=line, airspeed_scale=scale,
        airspeed_scale_error=0.001,
    )  # fmt: skip
    lines = of_transducers(calibration)
    assert (
        lines[0] == "/probe/alpha: slope 1.0210 ± 0.0039 (95 % interval), offset -2.3 Pa, 0.5 Pa at most off the line"
    )
    assert [text.split(":")[0] for text in lines[:3]] == ["/probe/alpha", "/probe/beta", "/probe/airspeed"]
    assert lines[3] == f"airspeed reads 1.23 ± 0.20 % too {side} without this calibration"


@pytest.mark.parametrize(
    ("text", "expected"),
    [("100 200,300 Pa", [100, 200, 300]), ("1 -2 hPa", [100, -200]), ("0 10 mm", [998.2 * GRAVITY_MPS2 * 0.01]),
     ("19990 Pa", [19_990])],
)  # fmt: skip
def test_pressures_are_those_of_a_unit_or_of_a_column_of_water_at_20_degC(text: str, expected) -> None:
    assert pressures_Pa(text) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [("10 20", "their unit are needed"), ("10 x 20 mm", "'x' is no number"), ("10 kg", "'kg' is no unit"),
     ("20010 Pa", "not within 20000 Pa"), ("10 nan Pa", "'nan' is no number"),
     ("-20010 Pa", "not within"), ("mm", "their unit are needed")],
)  # fmt: skip
def test_pressures_that_are_none_are_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        pressures_Pa(text)


def test_angles_of_a_surface_are_below_a_right_angle() -> None:
    assert [_angle_deg(word) for word in ("-22.5", "89", "-", "-89.9")] == [-22.5, 89.0, None, -89.9]
    for word in ("90", "-90.5", "x", "nan"):
        with pytest.raises(InputError, match="is not an angle in degrees"):
            _angle_deg(word)


def test_the_scale_s_error_under_an_autopilot_is_that_of_the_comparison_with_gps(monkeypatch, tmp_path) -> None:
    """Flight is recognized by a wing loading of 60 N/m^2; headings are those of the motion through the air, in
    flight."""
    heading = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    velocity = {GPS[0]: 15 * np.cos(heading) - 4.0, GPS[1]: 15 * np.sin(heading), GPS[2]: 0.0}
    flown = SimpleNamespace(
        table=pd.DataFrame(velocity), flown=np.ones(400, dtype=bool), notes=["of the flight"], first_wind_mps=None
    )
    loading = []
    errors = AirspeedErrors(0.02, 1.0, np.diag([0.003**2, 4.0]), 4.0, 0.0)
    monkeypatch.setattr("flightpower.analysis.sources.autopilot.read_autopilot_log", lambda *_: None)
    monkeypatch.setattr(
        "flightpower.analysis.methods.whole_flight.flight_table.flight_table",
        lambda _, W, S: loading.append(W / S) or flown,
    )
    monkeypatch.setattr("flightpower.analysis.methods.whole_flight.airspeed_gps.airspeed_errors", lambda _: errors)
    calibration = autopilot_airspeed(tmp_path / "log.ulg", Autopilot.PX4)
    assert (calibration.scale, calibration.scale_error, calibration.wind_mps) == (0.02, pytest.approx(0.003), 4.0)
    assert calibration.one_way == pytest.approx(0.0, abs=1e-9) and loading == [60.0] and calibration.unsupported == ""
    assert calibration.notes[0] == "of the flight"
    monkeypatch.setattr(
        "flightpower.analysis.methods.whole_flight.airspeed_gps.airspeed_errors",
        lambda _: errors._replace(wind_mps=None),
    )
    with pytest.raises(InputError, match="no GPS velocity in flight"):
        autopilot_airspeed(tmp_path / "log.ulg", Autopilot.PX4)
