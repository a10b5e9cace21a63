"""Figures show the quantities named on their axes."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace

from flightpower.analysis.curve import Polar
from flightpower.analysis.estimation.fit import Convergence
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.kinds import ACCELERATION
from flightpower.analysis.methods.dynamic import DRAG_TITLE, SPEED_TITLE, RunFit
from flightpower.analysis.methods.interval_sources import Share
from flightpower.analysis.pages.charts import flight, power
from flightpower.analysis.pages.charts import power as methods
from flightpower.analysis.pages.charts.figure import Band, Bars, Dash, Figure, Line, Mark, Points
from flightpower.analysis.pages.charts.style import BLUE, GRID, RED, thinned
from flightpower.analysis.pages.sections import certainty
from flightpower.analysis.records.flight import Correlation, Results, SpeedInterval


def named(figure: Figure, name: str) -> list[Mark]:
    """Marks of a legend entry, without its band."""
    return [mark for mark in figure.named(name) if not isinstance(mark, Band)]


def test_the_autocorrelation_has_the_bounds_of_white_noise() -> None:
    run = SimpleNamespace(
        run="acceleration at 10 s", kind=ACCELERATION, step_s=0.2, points=100, autocorrelation=[1.0, 0.3, -0.1]
    )
    figure = flight.autocorrelation([run])  # type: ignore[list-item]
    assert list(figure.marks[0].x) == pytest.approx([0.0, 0.2, 0.4])
    bounds = named(figure, "95 % bound of white noise")
    assert [bound.y[0] for bound in bounds] == pytest.approx([-0.1 * NORMAL_95, 0.1 * NORMAL_95])
    assert bounds[0].x == pytest.approx([0.0, 0.4])


def test_the_convergence_shows_cost_above_the_last_and_step_by_iteration() -> None:
    """Costs are drawn from the start, steps from the first iteration; a cost below the last one has no logarithm."""
    convergence, other = (
        Convergence((-1.0, -3.99, -4.0), (2.0, 0.12345678)),
        Convergence((0.0, -1.1, -1.0), (1.0, 1e-5)),
    )
    figure = flight.convergence({"drag": convergence, "cross-check": other})
    cost, step = named(figure, "drag")
    assert list(cost.x) == [0, 1] and list(cost.y) == pytest.approx([3.0, 0.01])
    assert list(step.x) == [1, 2] and list(step.y) == pytest.approx([2.0, 0.12345678])
    assert np.isnan(named(figure, "cross-check")[0].y[1])
    assert [axis.logarithmic for axis in figure.ys] == [True, True]
    assert flight.convergence({"long": Convergence((3.0,) * 41, (1.0,) * 40)}).x.step == 6


def test_each_correlation_stands_in_its_row_and_column_with_the_color_of_its_sign() -> None:
    matrix = [[1.0, -0.8, 0.4], [-0.8, 1.0, 0.0], [0.4, 0.0, 1.0]]
    figure = flight.correlation(Correlation(names=["A0", "A1", "thrust_scale"], matrix=matrix))
    (cells,) = figure.marks
    assert isinstance(cells, Bars) and cells.base is not None and cells.colors and cells.opacities
    cell_numbers = {(int(x), int(base)): i for i, (x, base) in enumerate(zip(cells.x, cells.base, strict=True))}
    first_row_second_column, first_row_third_column = cell_numbers[1, 2], cell_numbers[2, 2]
    assert cells.texts[first_row_second_column] == "−0.80" and cells.texts[first_row_third_column] == "+0.40"
    look = list(zip(cells.colors, cells.opacities, strict=True))
    assert look[first_row_second_column] == (RED, 0.4) and look[first_row_third_column] == (BLUE, 0.2)
    assert look[cell_numbers[0, 2]] == (GRID, 1.0)
    assert figure.y.ticks == {2.5: "A0", 1.5: "A1", 0.5: "thrust\nscale"}


def test_the_path_s_airspeed_and_angle_of_attack_are_relative_to_the_wind() -> None:
    """The aircraft flies north at 15 m/s through the air, descending at 10 deg with the nose 5 deg below the horizon,
    in wind of 4 m/s from the south and 2 m/s from the west."""
    item, descent = np.ones(50), np.radians(10)
    states = {"v_north": (15 * np.cos(descent) + 4) * item, "v_east": 2 * item, "v_down": 15 * np.sin(descent) * item}
    states |= {"wind_north": 4 * item, "wind_east": 2 * item}
    states |= {"phi": 0 * item, "theta": np.radians(-5) * item, "psi": 0 * item}

    class Blocks(dict):
        flying, t_s = np.arange(50) > 10, np.arange(50) * 0.2

    trajectory = SimpleNamespace(
        block_means=Blocks(V_mps=15 * item, alpha_rad=np.radians(5) * item),
        states=pd.DataFrame(states),
    )
    figure = flight.air_and_path(trajectory)  # type: ignore[arg-type]
    for trace, expected in zip(figure.marks, (15, 15, 5, 5), strict=True):
        y = np.asarray(trace.y, dtype=float)
        assert np.isnan(y[:10]).all() and y[20:] == pytest.approx(expected, abs=1e-3)


def test_the_wind_s_arrow_points_where_the_wind_blows() -> None:
    """Wind from 300 deg blows to the east and south; the arrow has 15 % of the track's size and starts at its upper
    left corner."""
    track = SimpleNamespace(t_s=[0.0, 1.0, 2.0], north_m=[0.0, 100.0, 200.0], east_m=[10.0, 20.0, 30.0])
    run = SimpleNamespace(kind=ACCELERATION, start_s=0.5, end_s=2.0, name="acceleration 1")
    air = SimpleNamespace(wind_from_deg=300.0, wind_mps=5.0)
    figure = flight.ground_track(track, [run], air)  # type: ignore[arg-type]
    (arrow,) = named(figure, "wind, 5.0 m/s")
    x, y = (values for values in (arrow.x, arrow.y))
    assert (x[0], y[0]) == (10.0, 200.0)
    assert (x[1] - x[0], y[1] - y[0]) == pytest.approx(
        (30 * np.sin(np.radians(120)), 30 * np.cos(np.radians(120))), rel=1e-3
    )
    (colored,) = named(figure, ACCELERATION)
    assert list(colored.y) == [100.0, 200.0]


def test_the_power_curve_is_drawn_with_its_band_and_its_optimum(with_battery: Results) -> None:
    results = with_battery
    figure = power.power_required(results)
    V, P, lo, hi = np.array([(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in results.power_required]).T
    band = figure.marks[0]
    assert np.asarray(band.y) == pytest.approx(np.r_[hi, lo[::-1]], abs=0.01)
    assert np.asarray(band.x) == pytest.approx(np.r_[V, V[::-1]], abs=0.01)
    (mark,) = named(figure, "least drag")
    assert mark.y == pytest.approx([np.interp(13.1, V, P)])
    assert isinstance(mark, Points) and mark.x_ends is not None
    assert mark.x_ends.ravel() == pytest.approx([12.8, 13.4])
    assert figure.y.limits is not None
    top = figure.y.limits[1]
    assert hi.max() < top <= 2.2 * 1.12 * hi.max()
    (continuation,) = [t for t in named(figure, "power required") if isinstance(t, Line) and t.dash is Dash.LONG]
    v = np.asarray(continuation.x, dtype=float)
    assert (v[0], v[-1]) == pytest.approx((24.0, 25.0))
    CL = 37.0 / (0.6 * v**2 * 0.46)
    assert np.asarray(continuation.y) == pytest.approx(0.6 * v**3 * 0.46 * (0.045 + 0.065 * CL**2), rel=1e-3)


def test_a_bar_is_half_the_interval_and_its_pieces_are_shares_of_the_variance(results: Results) -> None:
    V = np.array([12.0, 18.0, 24.0])
    variances = {Share.NOISE: np.array([1.0, 4.0, 9.0]), Share.WEIGHT: np.array([3.0, 4.0, 0.0]),
                 Share.DENSITY: np.full(3, 1e-3)}  # fmt: skip
    powers = np.interp(V, *np.array([(p.speed_mps, p.power_W) for p in results.power_required]).T)
    noise, weight = power.interval_by_source(results.power_required, V, variances).marks
    half = 100 * NORMAL_95 * np.array([2.0, np.sqrt(8), 3.0]) / powers
    assert np.asarray(noise.y) == pytest.approx(half * [0.25, 0.5, 1.0], rel=2e-3)
    assert np.asarray(weight.y) == pytest.approx(half * [0.75, 0.5, 0.0], rel=2e-3, abs=1e-3)


def test_curve_interval_and_continuation_are_one_entry_of_the_legend(with_battery: Results) -> None:
    figure = power.power_required(with_battery)
    of_curve = figure.named(power.REQUIRED)
    assert figure.entries().count(power.REQUIRED) == 1
    assert {t.dash for t in of_curve if isinstance(t, Line)} == {Dash.SOLID, Dash.DASHED, Dash.LONG}
    assert sum(isinstance(t, Band) for t in of_curve) == 1


def test_only_the_curve_and_its_cross_check_are_drawn_until_others_are_asked_for(results: Results) -> None:
    many = replace(results, methods=[*results.methods, replace(results.methods[0], name="energy", title="energy")])
    figure = methods.every_method(many)
    hidden = {mark.name for mark in figure.marks if mark.hidden}
    assert hidden == {"PIW-VIW", "Energy"} and len({mark.name for mark in figure.marks}) == 4


def test_residuals_are_in_per_cent_of_the_drag_of_the_model() -> None:
    t_s = np.arange(50) * 0.2
    V, drag = np.linspace(24, 12, 50), np.linspace(2.0, 1.0, 50)
    fit = RunFit("deceleration at 5 s", t_s, {DRAG_TITLE: 1.03 * drag}, {SPEED_TITLE: V, DRAG_TITLE: drag})
    (trace,) = flight.residuals_of_drag([fit], {"deceleration at 5 s": "deceleration"}).marks
    assert trace.y == pytest.approx(3.0, abs=1e-3) and len(trace.x) == 10
    assert trace.name == "deceleration" and trace.run == "deceleration at 5 s"


def test_the_drag_polar_is_drawn_with_its_interval() -> None:
    polar = Polar(np.array([0.04, -0.01, 0.06]), np.diag([4e-6, 0.0, 0.0]))
    band, curve = power.drag_polar(polar, (0.2, 1.0)).marks
    CL, CD = np.asarray(curve.y), np.asarray(curve.x)
    assert (CL[0], CL[-1]) == (0.2, 1.0)
    assert CD == pytest.approx(0.04 - 0.01 * CL + 0.06 * CL**2, abs=1e-5)
    assert np.asarray(band.x)[:60] == pytest.approx(CD - 1.96 * 0.002, abs=1e-5)
    assert np.asarray(band.x)[60:] == pytest.approx((CD + 1.96 * 0.002)[::-1], abs=1e-5)


def test_bars_of_the_methods_are_their_intervals(results: Results) -> None:
    figure = methods.every_method(results)
    bars = next(t for t in figure.marks if isinstance(t, Points) and len(t.x) == 4)
    assert bars.y_ends is not None
    (method,) = [m for m in results.methods if m.power_required]
    V, P, lo, hi = np.array([(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in method.power_required]).T
    bar_speeds = np.asarray(bars.x, dtype=float)
    assert np.diff(bar_speeds) == pytest.approx([3.0] * 3) and V[0] < bar_speeds[0] and bar_speeds[-1] < V[-1]
    assert bars.y_ends[1] - bars.y == pytest.approx(np.interp(bar_speeds, V, hi - P), abs=0.01)
    assert bars.y - bars.y_ends[0] == pytest.approx(np.interp(bar_speeds, V, P - lo), abs=0.01)
    highest = max(p.power_hi_W for p in results.power_required)
    assert figure.y.limits == pytest.approx((0, 1.3 * highest))


def test_thinning_keeps_extremes_and_gaps() -> None:
    x = np.arange(5000.0)
    y = np.sin(x / 700)
    y[1234], y[3000:3200] = 9.0, np.nan
    kept_x, kept_y = thinned(x, y)
    assert len(kept_x) <= 1000 and np.nanmax(kept_y) == 9.0 and np.isnan(kept_y).sum() >= 20
    assert (np.diff(kept_x) > 0).all()


def test_more_runs_halve_the_interval_only_if_they_shrink_the_larger_part(results: Results) -> None:
    """noise^2/n + shared^2 = (noise^2 + shared^2)/4."""
    part = replace(results.interval_parts[0], noise_W=4.0, systematic_W=1.0)
    n = certainty.more_runs_to_halve(part, 10)
    assert n is not None
    for more, enough in ((n, True), (n - 1, False)):
        half = np.hypot(4.0 / np.sqrt((10 + more) / 10), 1.0)
        assert bool(half <= np.hypot(4.0, 1.0) / 2) == enough
    assert certainty.more_runs_to_halve(replace(part, systematic_W=2.4), 10) is None


def test_a_slow_flight_s_margin_is_in_speed_and_an_unknown_optimum_is_advice(results: Results) -> None:
    slowest = SimpleNamespace(speed_mps=12.0, lift_coefficient=0.8, largest_lift_coefficient=1.16)
    shown = SimpleNamespace(slowest_flown=slowest)
    assert "margin of 20 % of speed" in certainty.stall_margin(shown)  # type: ignore[arg-type]
    slowest.largest_lift_coefficient = 0.803
    assert "margin to the stall is unknown" in certainty.stall_margin(shown)  # type: ignore[arg-type]
    none = SpeedInterval(speed_mps=None, lo_mps=None, hi_mps=None, inside_flown_range=False)
    assert results.minimum_power_speed == none
