"""Values to type into an autopilot: units of each firmware, what is withheld."""

import pytest

from analysis.results.autopilot_parameters import FlightValues, around, typed_in, wing_loading_of


def values(**given: object) -> FlightValues:
    speeds = {"cruise": around(15.0, 1.0), "slowest": around(12.0, 0.2), "fastest": around(20.0, 0.3)}
    return FlightValues(**speeds, wing_loading=wing_loading_of(37.7, 0.46), **given)  # type: ignore[arg-type]


def by_name(flight: FlightValues) -> dict[str, tuple[float, float, float]]:
    return {one.name: (one.value, one.lo, one.hi) for one in typed_in(flight)[0]}


def test_each_firmware_has_its_unit() -> None:
    found = by_name(values(cruise_power=around(96.0, 10.0)))
    assert found["AIRSPEED_CRUISE"] == found["FW_AIRSPD_TRIM"] == (15.0, 14.0, 16.0)
    assert found["TRIM_ARSPD_CM"] == found["nav_fw_cruise_speed"] == (1500.0, 1400.0, 1600.0)
    assert found["cruise_power"][0] == 9600.0  # hundredths of a watt
    assert found["SOAR_POLAR_K"][0] == pytest.approx(16 * 37.7 / 9.80665 / 0.46, rel=2e-3)  # ArduPilot's own rule


def test_the_pitots_ratio_goes_with_the_square_of_airspeed() -> None:
    """Airspeed that reads 10 % high by a ratio of 2."""
    flight = values(airspeed_factor=around(1 / 1.1, 0.01), logged={"ARSPD_RATIO": 2.0})
    found = {one.name: one for one in typed_in(flight)[0]}
    assert found["ARSPD_RATIO"].value == pytest.approx(2.0 / 1.21) and found["ARSPD_RATIO"].logged == 2.0
    assert found["ASPD_SCALE_1"].value == pytest.approx(1 / 1.1)


def test_what_is_not_known_is_withheld_with_what_it_takes() -> None:
    parameters, withheld = typed_in(values(sink=around(0.6, 0.5), CD0=around(0.03, 0.005)))
    assert not {one.name for one in parameters} & {"FW_T_SINK_MIN", "SOAR_POLAR_CD0", "cruise_power", "ARSPD_RATIO"}
    told = " ".join(withheld)
    assert all(name in told for name in ("FW_T_SINK_MIN", "SOAR_POLAR_CD0", "cruise_power", "ARSPD_RATIO"))
