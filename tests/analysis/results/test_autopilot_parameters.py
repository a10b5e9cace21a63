"""Values to type into an autopilot have the units of each firmware; unknown values are withheld."""

from types import SimpleNamespace
from typing import Any

import pytest

from flightpower.analysis.performance.autopilot_parameters import (
    FlightValues,
    around,
    of_power_required,
    typed_in,
    wing_loading_of,
)
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY


def values(**values_by_name: object) -> FlightValues:
    speeds = {"cruise": around(15.0, 1.0), "slowest": around(12.0, 0.2), "fastest": around(20.0, 0.3)}
    return FlightValues(**speeds, wing_loading=wing_loading_of(37.7, 0.46), **values_by_name)  # type: ignore[arg-type]


def by_name(flight: FlightValues) -> dict[str, tuple[float, float, float]]:
    return {item.name: (item.value, item.lo, item.hi) for item in typed_in(flight)[0]}


def test_each_firmware_has_its_unit() -> None:
    result = by_name(values(cruise_power=around(96.0, 10.0)))
    assert result["AIRSPEED_CRUISE"] == result["FW_AIRSPD_TRIM"] == (15.0, 14.0, 16.0)
    assert result["TRIM_ARSPD_CM"] == result["nav_fw_cruise_speed"] == (1500.0, 1400.0, 1600.0)
    assert result["cruise_power"][0] == 9600.0  # hundredths of a watt
    assert result["SOAR_POLAR_K"][0] == pytest.approx(16 * 37.7 / 9.80665 / 0.46, rel=2e-3)  # ArduPilot's own formula


def test_the_pitots_ratio_goes_with_the_square_of_airspeed() -> None:
    """With a ratio of 2, airspeed reads 10 % high."""
    flight = values(airspeed_factor=around(1 / 1.1, 0.01), logged={"ARSPD_RATIO": 2.0})
    results = {item.name: item for item in typed_in(flight)[0]}
    assert results["ARSPD_RATIO"].value == pytest.approx(2.0 / 1.21) and results["ARSPD_RATIO"].logged == 2.0
    assert results["ASPD_SCALE_1"].value == pytest.approx(1 / 1.1)


def test_what_is_not_known_is_withheld_with_what_it_takes() -> None:
    parameters, withheld = typed_in(values(sink=around(0.6, 0.5), CD0=around(0.03, 0.005)))
    assert not {parameter.name for parameter in parameters} & {
        "FW_T_SINK_MIN",
        "SOAR_POLAR_CD0",
        "cruise_power",
        "ARSPD_RATIO",
    }
    message = " ".join(withheld)
    assert all(name in message for name in ("FW_T_SINK_MIN", "SOAR_POLAR_CD0", "cruise_power", "ARSPD_RATIO"))


def curve_of(use: object = None, best: tuple[float | None, float | None, float | None] = (15.0, 14.0, 16.5)) -> object:
    """Return results for 40 N at 1.0 kg/m^3 and 12 to 20 m/s, with a power of 10 W per m/s known to a tenth."""
    speeds = [12.0, 14.0, 16.0, 18.0, 20.0]
    curve = [SimpleNamespace(speed_mps=v, power_W=10 * v, power_lo_W=9 * v, power_hi_W=11 * v) for v in speeds]
    return SimpleNamespace(
        power_required=curve,
        use=use,
        test=SimpleNamespace(air_density_kgpm3=1.0, weight_N=40.0),
        best_range_speed=SimpleNamespace(speed_mps=best[0], lo_mps=best[1], hi_mps=best[2]),
        aircraft=SimpleNamespace(wing_area_m2=0.5),
    )


def parameters_of(results: Any) -> dict[str, tuple[float, float, float]]:
    return {item.name: (item.value, item.lo, item.hi) for item in of_power_required(results, results.use)[0]}


TO_EQUIVALENT = (1.0 / SEA_LEVEL_DENSITY) ** 0.5


@pytest.mark.parametrize(
    ("best", "cruise"),
    [
        ((15.0, 14.0, 16.5), (15.0, 14.0, 16.5)),
        ((15.0, None, 16.5), (15.0, 12.0, 16.5)),  # no lower end: the slowest speed flown
        ((11.0, 10.0, 11.5), (12.0, 12.0, 12.0)),  # best range below all speeds flown
        ((21.0, 19.0, 23.0), (20.0, 19.0, 23.0)),
        ((None, None, None), (12.0, 12.0, 12.0)),
    ],
)
def test_the_cruise_is_that_of_best_range_among_the_speeds_flown(best, cruise) -> None:
    """The parameters are equivalent airspeeds."""
    result = parameters_of(curve_of(best=best))
    assert result["FW_AIRSPD_TRIM"] == pytest.approx(tuple(v * TO_EQUIVALENT for v in cruise))
    assert result["FW_AIRSPD_MIN"] == pytest.approx((12.0 * TO_EQUIVALENT,) * 3)
    assert result["FW_AIRSPD_MAX"] == pytest.approx((20.0 * TO_EQUIVALENT,) * 3)


def test_sink_is_power_required_over_weight() -> None:
    assert parameters_of(curve_of())["FW_T_SINK_MIN"] == pytest.approx((150 / 40.0, 135 / 40.0, 165 / 40.0))


def test_the_cruise_s_power_is_as_uncertain_as_the_range() -> None:
    """Battery power goes with the inverse of range, which is 40 km with an interval from 30 to 50 km."""
    distance = SimpleNamespace(value=40e3, lo=30e3, hi=50e3)
    cruise = SimpleNamespace(value=16.0, lo=15.0, hi=17.0)
    case = SimpleNamespace(range_speed_mps=cruise, range_power_W=200.0, range_m=distance)
    result = parameters_of(curve_of(SimpleNamespace(loadings=[case])))
    assert result["cruise_power"] == pytest.approx((20_000.0, 16_000.0, 20_000.0 * 4 / 3))
    assert result["FW_AIRSPD_TRIM"] == pytest.approx(tuple(v * TO_EQUIVALENT for v in (16.0, 15.0, 17.0)))
    case.range_m = SimpleNamespace(value=40e3, lo=-1.0, hi=90e3)
    assert "cruise_power" not in parameters_of(curve_of(SimpleNamespace(loadings=[case])))


def test_a_wing_loading_is_as_uncertain_as_a_weighed_mass() -> None:
    """The wing loading 2 W/(rho_0 S) has a standard error of 0.5 %."""
    interval = wing_loading_of(40.0, 0.5)
    assert (interval.value, interval.lo, interval.hi) == pytest.approx(
        tuple(f * 160 / SEA_LEVEL_DENSITY for f in (1, 0.9902, 1.0098))
    )


def test_without_a_curve_nothing_is_reported() -> None:
    assert of_power_required(SimpleNamespace(power_required=[]), None) == ([], [])  # type: ignore[arg-type]
