"""Figures of a probe's calibration, of several flights, of the battery's power and of the whole flight."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace

from flightpower.analysis.calibrations import probe as calibration_page
from flightpower.analysis.calibrations import probe as probe_calibration
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.kinds import ACCELERATION, STANDING
from flightpower.analysis.pages import pooled_page
from flightpower.analysis.pages.charts import flight, power
from flightpower.analysis.pages.charts.figure import Band, Dash, Figure, Line, Mark, Points, Symbol
from flightpower.analysis.records.flight import Kind, MeasuredEfficiencyPoint, PowerPoint, Results
from flightpower.analysis.records.pool import Deviation
from flightpower.analysis.trajectory.consistency import ANGLES, SPEED, Consistency
from flightpower.flight.units import GRAVITY_MPS2


def named(figure: Figure, name: str) -> list[Mark]:
    """Marks of a legend entry, without its band."""
    return [mark for mark in figure.named(name) if not isinstance(mark, Band)]


def labeled(figure: Figure, label: str) -> Mark:
    (mark,) = [mark for mark in figure.marks if mark.label == label]
    return mark


def tunnel(speeds: list[float]) -> SimpleNamespace:
    """A probe whose pressure coefficients have slopes of 4 over alpha and 3 over beta [1/rad], at angles 5 deg
    apart."""
    V, alpha, beta = (
        x.ravel() for x in np.meshgrid(speeds, np.radians([-10, -5, 0, 5, 10]), np.radians([-5, 0, 5]), indexing="ij")
    )
    q_c = 0.6 * V**2
    return SimpleNamespace(
        speed_mps=V, alpha_rad=alpha, beta_rad=beta, q_c_Pa=q_c, dp_alpha_Pa=4 * alpha * q_c, dp_beta_Pa=3 * beta * q_c
    )


def test_residuals_lie_at_their_angles_with_a_symmetric_scale_of_colors() -> None:
    measured = tunnel([10.0, 15.0, 20.0])
    residual = np.linspace(-2.0, 1.0, len(measured.alpha_rad))
    maps = probe_calibration.residual_maps(measured, (residual,) * 3)  # type: ignore[arg-type]
    assert [residual_map.heading for residual_map in maps] == ["alpha, deg", "beta, deg", "q_c/q, %"]
    shown = sorted((z, x, y) for mark in maps[0].marks for z, x, y in zip(_z(mark), mark.x, mark.y, strict=True))
    z, x, y = np.array(shown).T  # in rising order, as the residuals are
    assert z == pytest.approx(residual) and y == pytest.approx(np.degrees(measured.beta_rad))
    aside = x - np.degrees(measured.alpha_rad)
    # Speeds lie side by side, within a degree of the angle, the slowest on the left.
    assert all(np.ptp(aside[measured.speed_mps == V]) < 1e-3 for V in (10.0, 15.0, 20.0))
    assert -1 < aside[0] < -0.5 and 0.5 < aside[-1] < 1 and aside.mean() == pytest.approx(0.0, abs=1e-3)
    end = float(np.percentile(np.abs(residual), 99))
    assert len({mark.color for mark in maps[0].marks}) == 5
    assert maps[0].entries()[2] == f"{-end / 5:+.2g} to {end / 5:+.2g}", "as far below zero as above it"
    assert np.max(np.abs(_z(maps[0].marks[2]))) <= end / 5
    alone = probe_calibration.residual_maps(tunnel([15.0]), (residual[:15],) * 3)[0]  # type: ignore[arg-type]
    x = np.sort(np.concatenate([mark.x for mark in alone.marks]))
    assert x == pytest.approx(np.sort(np.degrees(tunnel([15.0]).alpha_rad)), abs=1e-3)


def _z(mark: Mark) -> np.ndarray:
    assert mark.z is not None
    return mark.z


def test_sections_are_coefficients_over_the_angle_in_degrees() -> None:
    measured = tunnel([10.0, 20.0])
    calibration = SimpleNamespace(maps=lambda C_alpha, C_beta: (C_alpha / 4, C_beta / 3))
    by_alpha, by_beta = probe_calibration.sections(measured, calibration)  # type: ignore[arg-type]
    for figure, slope, end_deg in ((by_alpha, 4, 10), (by_beta, 3, 5)):
        for points in [*named(figure, "10 m/s"), *named(figure, "20 m/s"), *named(figure, "calibration")]:
            x, y = np.asarray(points.x), np.asarray(points.y)
            assert y == pytest.approx(slope * np.radians(x), abs=1e-3)
            assert (x[0], x[-1]) == pytest.approx((-end_deg, end_deg), abs=1e-3)
        assert len(named(figure, "10 m/s")[0].x) == 2 * end_deg / 5 + 1, "one angle where the other is zero"


def test_the_dependence_on_speed_is_in_per_cent_and_degrees() -> None:
    speeds = [
        SimpleNamespace(speed_mps=V, offset_rad=0.01 * V / 10, slope=0.02, slope_error=0.005) for V in (10.0, 20.0)
    ]
    slope, offset = probe_calibration.by_speed(SimpleNamespace(speeds=speeds))  # type: ignore[arg-type]
    (points,) = slope.marks
    assert np.asarray(points.y) == pytest.approx([2.0, 2.0])
    drawn_to = 1e-5
    assert isinstance(points, Points) and points.y_ends is not None
    assert points.y_ends[1] - points.y == pytest.approx([0.5 * NORMAL_95] * 2, abs=drawn_to)
    (points,) = offset.marks
    assert np.asarray(points.y) == pytest.approx(np.degrees([0.01, 0.02]), abs=1e-4)
    assert isinstance(points, Points) and points.y_ends is None


def test_the_orders_tried_begin_with_one_and_the_chosen_is_marked() -> None:
    surface = SimpleNamespace(tried_rms=[0.02, 0.01, 0.015], order=2)
    calibration = SimpleNamespace(alpha_rad=surface, beta_rad=surface, q_ratio=surface)
    figure = probe_calibration.polynomial_orders(calibration)  # type: ignore[arg-type]
    for axis, factor in zip(probe_calibration.QUANTITIES, (180 / np.pi, 180 / np.pi, 100.0), strict=True):
        tried, chosen = named(figure, axis.title)
        assert list(tried.x) == [1, 2, 3]
        assert np.asarray(tried.y) == pytest.approx(factor * np.array([0.02, 0.01, 0.015]), rel=1e-3)
        assert isinstance(chosen, Points) and chosen.symbol is Symbol.DIAMOND
        assert list(chosen.x) == [2] and chosen.y == pytest.approx([factor * 0.01])


def test_a_flight_of_a_pool_lies_off_the_pool_by_its_difference() -> None:
    def point(speed: float) -> PowerPoint:
        P = 5 * speed
        return PowerPoint(speed_mps=speed, power_W=P, power_lo_W=0.9 * P, power_hi_W=1.1 * P, extrapolated=speed > 19)

    def flight(log: str, difference: float, limit: float) -> SimpleNamespace:
        deviations = [Deviation(speed_mps=V, difference_percent=difference, limit_percent=limit) for V in (12.0, 16.0)]
        day = 86400.0 * {"a": 2, "b": 1}[log]
        return SimpleNamespace(
            log=log, outlier=abs(difference) > limit + 2, against_pool=deviations, start_unix_s=day,
            share_of_information=0.4,
        )  # fmt: skip

    flights: Any = [flight("a", 4.0, 3.0), flight("b", -20.0, 5.0)]
    main = SimpleNamespace(points=[point(V) for V in (10.0, 15.0, 20.0)])
    content: Any = SimpleNamespace(main=main, kind=Kind.POWER_REQUIRED, flights=flights)
    figure = pooled_page.pooled_power(content)
    (alone,) = named(figure, "each flight alone")
    expected = [1.04 * 60, 1.04 * 80, np.nan, 0.8 * 60, 0.8 * 80, np.nan]
    assert np.asarray(alone.y) == pytest.approx(expected, abs=0.01, nan_ok=True)
    assert figure.y.limits is not None and figure.y.limits[1] > 110.0, "the whole band is seen"
    solid, dashed = named(figure, "power required, all flights")
    assert isinstance(dashed, Line) and dashed.dash is Dash.DASHED
    assert np.isnan(solid.y[-1]) and dashed.y[-1] == 100.0
    content.flights = flights[:1]
    assert not named(pooled_page.pooled_power(content), "each flight alone")
    against = pooled_page.against_pool(flights)
    points = [mark for mark in against.marks if isinstance(mark, Points)]
    slow, middle = points[:2], points[2:4]
    assert [mark.x[0] for mark in middle] == [-20.0, 4.0], "in order of date"
    assert [mark.x_ends for mark in slow] == [None, None] and slow[0].name == "12.0 m/s"
    for mark, limit in zip(middle, (5.0, 3.0), strict=True):
        assert mark.x_ends is not None and mark.x_ends.ravel() - mark.x == pytest.approx([-limit, limit])
    assert [mark.label for mark in middle] == ["1970-01-02 b", "1970-01-03 a"]
    assert [mark.symbol for mark in middle] == [Symbol.CROSS, Symbol.CIRCLE]
    shares = pooled_page.weights(flights).marks
    assert [float(bar.x[0]) for bar in shares] == [40.0, 40.0] and [float(bar.y[0]) for bar in shares] == [1.0, 0.0]
    assert against.y.limits is not None
    low, high = against.y.limits
    assert -1 < low < -0.5 and 1.5 < high < 2, "all rows are seen, the first flight on top"
    assert against.y.ticks == {1.0: "1970-01-02 b", 0.0: "1970-01-03 a"}
    many = pooled_page.against_pool(flights * 10)
    assert many.height_px - against.height_px == 17 * 24, "a row each, three at least"


def test_the_battery_s_power_and_the_flight_are_drawn_whole(results: Results) -> None:
    estimate = SimpleNamespace(measured_V_mps=np.array([12.0, 14.0]), measured_W=np.array([50.0, 60.0]))
    shown = replace(results, curves={Kind.ELECTRICAL: results.main})
    figure = power.electrical_power(shown, estimate)  # type: ignore[arg-type]
    highest = max(point.power_hi_W for point in results.power_required)
    assert figure.y.limits is not None and highest < figure.y.limits[1] < 1.5 * highest
    t = np.arange(0, 10, 0.5)
    table = pd.DataFrame({"height_m": 2 * t, "power_W": 30 + t}, index=t)
    flown = SimpleNamespace(table=table, airborne=[slice(4, 12)])
    figure = flight.whole_flight(flown, 15 + 0 * t)  # type: ignore[arg-type]
    assert labeled(figure, "height").y == pytest.approx(2 * t)
    (shade,) = figure.shades
    assert (shade.start, shade.end) == (2.0, 5.5)


def test_the_time_line_shows_revolutions_a_minute_and_shades_the_runs() -> None:
    t = np.arange(0, 10, 0.5)
    table = pd.DataFrame({"V_mps": 15 + 0 * t, "height_m": 40 + t, "n_revps": 100 + t}, index=t)
    run = SimpleNamespace(name="run", kind=ACCELERATION, start_s=2.0, end_s=5.0)
    parked = SimpleNamespace(kind=STANDING, start_s=0.0, end_s=1.0)
    rejected = SimpleNamespace(start_s=6.0, end_s=7.0)
    figure = flight.timeline(table, [run, parked], [rejected])  # type: ignore[list-item]
    assert labeled(figure, "motor").y == pytest.approx(60 * (100 + t))
    assert labeled(figure, "height").y == pytest.approx(40 + t)
    assert [(shade.start, shade.end) for shade in figure.shades] == [(2.0, 5.0), (6.0, 7.0)]


def test_differences_of_angles_are_in_degrees_and_those_of_a_fit_measured_minus_modeled() -> None:
    t = np.arange(5.0)
    before = pd.DataFrame({ANGLES: np.radians(2.0), SPEED: 0.5}, index=t)
    figure = flight.consistency(Consistency(before, before * 0.5))
    assert [trace.y[0] for trace in figure.marks] == pytest.approx([2.0, 1.0, 0.5, 0.25])
    both, differences = flight.run_fit("run 1", t, {"V": 15 + t}, {"V": 14 + t})
    assert np.asarray(both.marks[1].y) == pytest.approx(14 + t)
    assert np.asarray(differences.marks[0].y) == pytest.approx(1.0)
    two, _ = flight.run_fit("run 1", t, {"V": t, "h": t}, {"V": t, "h": t})
    assert two.panels == 2 and two.height_px > 1.5 * both.height_px, "each quantity has its panel"


def test_endurance_and_range_are_over_mass_and_efficiencies_in_per_cent(with_battery: Results) -> None:
    use = with_battery.use
    assert use is not None
    flown = use.loadings[0]
    heavier = replace(flown, title="heavier", weight_N=40.0)
    higher = replace(flown, title="higher", air_density_kgpm3=1.0, density_altitude_m=2000.0)
    endurance, distance = power.loadings(replace(use, loadings=[flown, heavier, higher]))
    for figure, value in ((endurance, 50.0), (distance, 40.0)):
        (as_flown,) = named(figure, "density altitude 200 m (as flown)")
        assert np.asarray(as_flown.x) == pytest.approx(np.array([37.0, 40.0]) / GRAVITY_MPS2, abs=1e-3)
        assert np.asarray(as_flown.y) == pytest.approx([value, value])
        band = figure.marks[0]
        assert np.asarray(band.y) == pytest.approx([1.2 * value] * 2 + [0.9 * value] * 2)
        assert len(named(figure, "density altitude 2000 m")[0].x) == 1
    point = MeasuredEfficiencyPoint(time_s=0.0, speed_mps=15.0, propeller=0.65, motor=0.8, overall=0.52)
    figure = power.efficiency(replace(use, power_train=replace(use.power_train, points=[point])))
    for name, value in (("propeller", 70.0), ("motor and controller", 80.0), ("overall", 56.0)):
        assert named(figure, name)[0].y[0] == pytest.approx(value)
    markers = [mark.y[0] for mark in figure.marks if isinstance(mark, Points)]
    assert markers == pytest.approx([65.0, 80.0, 52.0])
    assert figure.y.limits is not None
    low, high = figure.y.limits
    assert low == 0 and 100 <= high < 120


def test_the_page_of_a_calibration_tells_residuals_in_degrees_and_the_parts_of_the_slope_s_error() -> None:
    surface = SimpleNamespace(order=3, residual_rms=0.002)
    calibration = SimpleNamespace(
        alpha_rad=surface, beta_rad=surface, q_ratio=surface, alpha_scale_sigma=0.013,
        alpha_limits_rad=np.radians([-10.0, 15.0]), beta_limits_rad=None,
    )  # fmt: skip
    residuals = (np.array([0.3, -0.4]), np.array([0.1, 0.1]), np.array([2.0, 1.0]))
    table = calibration_page._quality(calibration, residuals)  # type: ignore[arg-type]
    assert table.rows[0] == ("alpha", "3", "0.115 deg", "0.354 deg", "0.400 deg")
    assert table.rows[2] == ("q_c/q", "3", "0.200 %", "1.581 %", "2.000 %")
    assert "for alpha from -10 to 15 deg." in calibration_page.validity(calibration)  # type: ignore[arg-type]
    dependence = SimpleNamespace(speeds=[1, 2], spread=0.004, significant=True)
    parts = calibration_page.slope_parts(calibration, dependence, 0.003)  # type: ignore[arg-type]
    assert parts == "angles of the tunnel 0.30 %, speed 0.40 %, noise and fit of the polynomial 1.20 %"
    assert "between speeds by 0.4 %" in calibration_page.speed_effect(dependence)  # type: ignore[arg-type]


def test_the_page_draws_residuals_in_degrees_and_per_cent(monkeypatch: pytest.MonkeyPatch) -> None:
    """The calibration reads 0.01 rad too high, and its ratio of pressures is 2 % too large."""
    measured = tunnel([10.0, 20.0])
    measured.q_c_Pa = 1.02 * measured.q_c_Pa

    def maps(C_alpha: Any, C_beta: Any) -> tuple[Any, Any, Any]:
        return measured.alpha_rad + 0.01, measured.beta_rad - 0.01, np.full(len(C_alpha), 1.02 * 1.02)

    class Drawn(Exception):
        pass

    def record_maps(_: Any, residuals: Any) -> Any:
        raise Drawn(*residuals)

    monkeypatch.setattr(calibration_page, "dynamic_pressure", lambda tunnel: 0.6 * tunnel.speed_mps**2)
    monkeypatch.setattr(calibration_page, "residual_maps", record_maps)
    with pytest.raises(Drawn) as raised:
        calibration_page.render(measured, SimpleNamespace(maps=maps), angle_scale_sigma=0.0)  # type: ignore[arg-type]
    alpha, beta, ratio = raised.value.args
    assert alpha == pytest.approx(np.degrees(0.01)) and beta == pytest.approx(-np.degrees(0.01))
    assert ratio == pytest.approx(2.0)
