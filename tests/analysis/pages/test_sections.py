"""Sentences and tables of the page give the numbers of the results in the units that they name."""

from types import SimpleNamespace

import pytest
from msgspec.structs import replace

from flightpower.analysis.pages.sections.certainty import certainty_section
from flightpower.analysis.pages.sections.curve import _power_at_ends, curve_section, methods_section
from flightpower.analysis.pages.sections.flight import (
    _air,
    _log,
    _place,
    _recorder,
    _ticks,
    _wind,
    balance_section,
    decimals,
    flight_section,
)
from flightpower.analysis.pages.sections.performance import ceilings, performance_section
from flightpower.analysis.pages.sections.summary import summary_section, verdict_section
from flightpower.analysis.records.flight import (
    AirFound,
    ConditionResult,
    EnergyBalanceResult,
    Interval,
    Kind,
    PowerPoint,
    RejectedResult,
    Results,
)

AIR = AirFound(
    wind_mps=5.0, wind_from_deg=310.0, wind_standard_error_mps=0.5, gust_mps=0.25, temperature_K=290.0, pressure_Pa=1e5,
    density_altitude_m=250.0, lowest_height_m=40.0, highest_height_m=60.0,
)  # fmt: skip


def facts_of(**facts: object) -> SimpleNamespace:
    return SimpleNamespace(provenance=SimpleNamespace(**facts))


def test_the_head_of_the_page_is_in_kilograms_and_degrees_celsius(results: Results) -> None:
    flight_condition = ConditionResult(weight_N=4.0 * 9.80665, air_density_kgpm3=1.2)
    condition = summary_section(replace(results, test=flight_condition, air=AirFound(temperature_K=290.15))).condition
    assert condition.startswith("4.00 kg, air 1.200 kg/m³ (17 °C)")


def test_runs_are_reported_with_their_lengths(results: Results) -> None:
    rejected = RejectedResult(kind="steady", start_s=30.0, end_s=37.5, reason="too short")
    section = flight_section(replace(results, rejected=[rejected]))
    assert section.runs.rows[0] == ("1", "acceleration", "10.0", "8.0", "12.0 to 24.0", "+0.0", "")
    assert section.rejected is not None and section.rejected.rows == [("steady", "30.0", "7.5", "too short")]


def test_a_method_is_reported_with_half_of_its_interval() -> None:
    curve = [
        PowerPoint(speed_mps=V, power_W=50.0, power_lo_W=46.0, power_hi_W=56.0, extrapolated=False)
        for V in (12.0, 24.0)
    ]
    assert _power_at_ends(curve) == ("50 ± 5 at 12.0 m/s", "50 ± 5 at 24.0 m/s")


def test_the_battery_s_share_and_the_ceilings_are_reported(with_battery: Results) -> None:
    section = performance_section(with_battery, with_battery.use)
    assert section is not None and section.battery == "74 Wh of which 80 % are used"
    assert with_battery.use is not None
    assert "Service ceiling (climb of 0.5 m/s): density altitude 3000" in ceilings(with_battery.use)
    only = replace(
        with_battery.use.available, service_ceiling_m=None, absolute_ceiling_m=Interval(value=9.0, lo=8, hi=9)
    )
    assert ceilings(replace(with_battery.use, available=only)).startswith("Absolute ceiling (no climb): density alt")


def test_wind_and_air_are_reported_with_95_per_cent_and_in_everyday_units(results: Results) -> None:
    with_air = replace(results, air=AIR)
    assert _wind(with_air) == "5.0 ± 1.0 m/s from 310°"
    facts = dict(_air(with_air))
    assert facts["Air"] == "16.9 °C, 1000 hPa, 1.200 kg/m³: density altitude 250 m"
    assert facts["Height of the runs"] == "40 to 60 m above the start"
    assert facts["Turbulence"] == "0.25 m/s vertical gusts (1 standard deviation)"
    short = dict(_air(replace(results, air=replace(AIR, gust_length=0.44))))
    assert short["Turbulence"].endswith(", 0.44 times as long as MIL-F-8785C has them, by their spectra")


@pytest.mark.parametrize(
    ("latitude", "longitude", "message"),
    [(48.1, 11.5, "48.10000° N 11.50000° E"), (-35.5, -70.25, "35.50000° S 70.25000° W"), (0.0, 0.0, "0.00000° N 0")],
)
def test_a_place_is_reported_by_its_hemispheres(latitude: float, longitude: float, message: str) -> None:
    place = facts_of(latitude_deg=latitude, longitude_deg=longitude, height_msl_m=512.4)
    assert _place(place).startswith(message)  # type: ignore[arg-type]
    assert _place(place).endswith(", 512 m above sea level")  # type: ignore[arg-type]


def test_the_log_s_size_and_missed_instants_are_reported() -> None:
    facts = SimpleNamespace(duration_s=600.0, log_bytes=12_340_000, log_sha256="abc")
    assert _log(SimpleNamespace(log="a.mcap"), facts) == "a.mcap, 600 s, 12.3 MB, SHA-256 abc"  # type: ignore[arg-type]
    assert _ticks(facts_of(ticks=990, ticks_missed=10)) == "10 of 1000 sampling instants were missed"  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("recorded_by", "ticks", "vehicle", "shown"),
    [
        ("1.2", 990, "", "flightpower 1.2"),
        ("PX4", None, "", "PX4"),
        ("PX4", None, "ab12", "PX4 ab12 (hash of its serial number)"),
        ("", None, "ab12", "autopilot ab12 (hash of its serial number)"),
        ("", None, "", "not known"),
    ],
)
def test_who_recorded_a_log_is_named(recorded_by: str, ticks: int | None, vehicle: str, shown: str) -> None:
    facts = SimpleNamespace(recorded_by=recorded_by, ticks=ticks)
    assert _recorder(SimpleNamespace(vehicle=vehicle), facts) == shown  # type: ignore[arg-type]


@pytest.mark.parametrize(("sigma", "shown"), [(12.0, 0), (1.0, 1), (0.12, 2), (0.012, 3), (0.0, 2)])
def test_a_standard_error_is_shown_with_two_digits(sigma: float, shown: int) -> None:
    assert decimals(sigma) == shown


def test_a_trusted_result_of_a_quarter_of_the_power_is_called_wide(results: Results) -> None:
    """±25 % or more at the speed of least drag is wide; less is not."""
    for share, wide in ((0.24, False), (0.26, True)):
        points = [replace(p, power_lo_W=(1 - share) * p.power_W, power_hi_W=(1 + share) * p.power_W)
                  for p in results.power_required]  # fmt: skip
        heading = verdict_section(results.with_curve(Kind.POWER_REQUIRED, points=points)).heading
        assert heading == ("Trusted, but wide (±26 %)" if wide else "Trusted")


def test_a_flight_of_electrical_power_has_the_sections_that_its_results_hold(results: Results) -> None:
    balance = EnergyBalanceResult(residual_W=3.0, flown_s=300.0, airspeed_scale=None)
    electrical = replace(
        results, kind=Kind.ELECTRICAL, curves={Kind.ELECTRICAL: results.main}, runs=[], methods=[], balance=balance,
        withheld=["Drag is not known."], drag_polar=None,
    )  # fmt: skip
    assert summary_section(electrical).title == "A & B: electrical power"
    assert flight_section(electrical) is None and methods_section(electrical) is None
    assert "from the battery" in verdict_section(electrical).sentence
    section = certainty_section(electrical)
    assert section.withheld == ["Drag is not known."] and section.stall == "" and "whole flight" in section.shared_part
    assert any("of the instruments" in text for text in section.next_flight), "2 W of 2.2 are shared"
    assert curve_section(electrical).drag is None and "5.0 min in the air" in curve_section(electrical).data
    assert balance_section(electrical) is not None and balance_section(results) is None
