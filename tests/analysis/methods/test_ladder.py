"""The best method that a flight allows gives its curve; if it fails, simpler ones still run."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from methods import draw_errors, fly

from flightpower.analysis import flight
from flightpower.analysis.curve import Polar, power_required, speed_at
from flightpower.analysis.maneuvers.find import find
from flightpower.analysis.maneuvers.flown import flown_lift
from flightpower.analysis.methods import ladder as estimate_module
from flightpower.analysis.methods.comparison import DYNAMIC
from flightpower.analysis.methods.ladder import by_simpler_method, estimate
from flightpower.analysis.methods.method import MethodEstimate
from flightpower.analysis.methods.methods import DIRECT, LADDER, NoMethod, fallback, informative, narrower, rejection_of
from flightpower.analysis.methods.methods_from_runs import ENERGY, VARIED_LIFT
from flightpower.analysis.methods.steady_points import PIW_VIW_THREE
from flightpower.analysis.methods.thrust_prior import THRUST
from flightpower.analysis.pipeline import runs as pipeline
from flightpower.analysis.records.flight import CurveStatus, MethodRejection, Trust
from flightpower.analysis.results.evidence import noise_limit
from flightpower.analysis.trajectory.as_measured import path_as_measured
from flightpower.analysis.trajectory.observability import misfit, with_misfit
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.sensors import load_budget
from tests.analysis.methods.flight_record import flight_record

AIRCRAFT = load_aircraft("nexstar")
GOOD, FLAT = np.array([0.04, 0.0, 0.06]), np.array([0.04, 0.0, -0.01])


def estimate_of(method, A=GOOD, sigma: float = 1e-3) -> MethodEstimate:
    C = np.diag([sigma**2, 0.0, 0.0])
    return MethodEstimate(
        method, Polar(A, C), C, 0 * C, sensitivities={name: np.zeros(3) for name in THRUST}, flown_CL=(0.3, 1.0)
    )


@pytest.fixture(scope="module")
def flown(probe):
    return fly(AIRCRAFT, probe, draw_errors(load_budget("bench"), 46), "accel-decel", 0.0, 46)


@pytest.fixture(scope="module")
def path(flown):
    return path_as_measured(flown.table, flown.still)


def test_a_polar_without_information_or_physics_is_no_curve() -> None:
    assert rejection_of(None, (0.3, 1.0)) is MethodRejection.NO_ESTIMATE
    assert rejection_of(Polar(FLAT, np.zeros((3, 3))), (0.3, 1.0)) is MethodRejection.UNPHYSICAL
    wide = Polar(GOOD, np.diag([0.06**2, 0, 0]))
    assert rejection_of(wide, (0.3, 1.0)) is MethodRejection.NO_INFORMATION and not informative(wide, (0.3, 1.0))
    assert rejection_of(Polar(GOOD, np.diag([0.02**2, 0, 0])), (0.3, 1.0)) is MethodRejection.NONE


@pytest.mark.parametrize(
    ("estimates", "reasons"),
    [
        ([estimate_of(ENERGY), estimate_of(PIW_VIW_THREE)], [MethodRejection.NONE]),
        ([estimate_of(ENERGY, sigma=0.2), estimate_of(PIW_VIW_THREE)],
         [MethodRejection.NO_INFORMATION, MethodRejection.NONE]),
        ([estimate_of(ENERGY, FLAT), MethodEstimate(PIW_VIW_THREE, notes=("few",)), estimate_of(VARIED_LIFT)],
         [MethodRejection.UNPHYSICAL, MethodRejection.NO_ESTIMATE, MethodRejection.NONE]),
        ([estimate_of(DIRECT), estimate_of(VARIED_LIFT)], [MethodRejection.NONE]),
    ],
)  # fmt: skip
def test_the_first_method_of_the_ladder_that_informs_gives_the_curve(path, estimates, reasons) -> None:
    estimate, _, tried = fallback(estimates, path, AIRCRAFT, "flight.mcap")
    assert [item.reason for item in tried] == reasons
    assert [item.name for item in tried] == [name for name in LADDER if name in {e.method.name for e in estimates}][
        : len(tried)
    ]
    assert estimate.status is CurveStatus.BY_ANOTHER_METHOD and all(item.text for item in tried[:-1])


def test_where_no_method_gives_a_curve_each_has_a_reason(path) -> None:
    with pytest.raises(NoMethod) as refused:
        fallback(
            [estimate_of(ENERGY, sigma=0.2), MethodEstimate(PIW_VIW_THREE, notes=("few",))], path, AIRCRAFT, "flight"
        )
    assert [method_tried.reason for method_tried in refused.value.tried] == [
        MethodRejection.NO_INFORMATION,
        MethodRejection.NO_ESTIMATE,
    ]
    text = str(refused.value)
    assert MethodRejection.NO_INFORMATION in text and MethodRejection.NO_ESTIMATE in text and not text.endswith(": ")


def test_without_a_trajectory_the_energy_of_the_runs_still_gives_the_truth(flown, path) -> None:
    """The measured path is marked as not converged, and the truth lies inside the interval of the curve."""
    assert path.as_measured and not path.converged
    record = record_of(flown, flown.table, path)
    drag = estimate(record)
    assert [method_tried.reason for method_tried in drag.ladder] == [
        MethodRejection.NO_TRAJECTORY,
        MethodRejection.NONE,
    ]
    assert drag.ladder[-1].name == ENERGY.name and drag.cross_check is None
    assert np.all(half_widths(drag, record, flown) < 0.5)


def record_of(flown, table, trajectory):
    """Return the record of a flight whose aircraft file lacks no key."""
    maneuvers = find(table, flown.still)
    rows = np.r_[tuple(run.rows for run in maneuvers.level_runs)]
    flown_CL = flown_lift(table.iloc[rows], AIRCRAFT)
    propeller = load_propeller(AIRCRAFT.propulsion.propeller)
    record = flight_record(table, trajectory, maneuvers.maneuvers, AIRCRAFT, propeller, flown_CL=flown_CL)
    everything_known = replace(AIRCRAFT, keys=frozenset({"probe.upwash_per_CL", "probe.position", "imu_position"}))
    return replace(record, contents=record.contents._replace(aircraft=everything_known))


def half_widths(drag, record, flown) -> np.ndarray:
    """Return half widths of the 95 % interval as shares of power, and check that truth lies inside at nine speeds."""
    V = speed_at(np.linspace(drag.flown_CL[0] * 1.1, drag.flown_CL[1] / 1.1, 9), record.condition)
    power, error = power_required(V, drag.main.polar, record.condition)
    truth = np.interp(V, flown.truth["speed_mps"], flown.truth["power_W"])
    assert np.all(np.abs(power - truth) < 1.96 * error)
    return np.asarray(1.96 * error / power)


def test_where_the_path_does_not_fit_a_late_altimeter_energy_gives_a_narrower_curve(flown, monkeypatch) -> None:
    """If height is 2 s late, no path fits both IMU and altimeter, but the energy of level runs hardly changes."""
    late = flown.table.assign(height_m=flown.table["height_m"].shift(50).bfill())
    trajectory, _ = with_misfit(reconstruct(late, flown.still))
    assert misfit(trajectory).keys() == {"height"}
    dynamic = estimate(record := record_of(flown, late, trajectory))
    as_measured = record_of(flown, late, path_as_measured(late, flown.still))
    simpler = by_simpler_method(as_measured, dynamic)
    assert [method_tried.reason for method_tried in dynamic.ladder] == [MethodRejection.NONE] and simpler is not None
    assert [(method_tried.name, method_tried.reason) for method_tried in simpler.drag.ladder] == [
        (DYNAMIC, MethodRejection.MISFIT), (ENERGY.name, MethodRejection.NONE),
    ]  # fmt: skip
    assert simpler.drag.main.status is CurveStatus.BY_ANOTHER_METHOD and simpler.drag.cross_check is None
    assert np.mean(half_widths(simpler.drag, record, flown)) < np.mean(half_widths(dynamic, record, flown))
    limit = noise_limit(1 + len(simpler.drag.runs_against_others))
    agreement = [*simpler.drag.runs_against_others, simpler.drag.accelerations_against_decelerations]
    assert len(agreement) > 1 and all(abs(item.z) < limit for item in agreement)
    monkeypatch.setattr(estimate_module, "estimate", lambda _: simpler.drag)
    certain = replace(dynamic, main=replace(dynamic.main, polar=Polar(dynamic.main.polar.A, np.zeros((3, 3)))))
    assert by_simpler_method(as_measured, certain) is None, "the narrower interval is kept"


N, D = Trust.NOT_TO_BE_TRUSTED, Trust.DOUBTFUL


@pytest.mark.parametrize(
    ("dynamic", "in_misfit", "simpler", "chosen"),
    [(N, True, D, "simpler"), (N, True, N, "dynamic"), (N, True, None, "dynamic"), (N, False, D, "dynamic"),
     (D, True, D, "dynamic")],
)  # fmt: skip
def test_only_a_curve_not_to_be_trusted_on_a_path_in_misfit_gives_way(
    monkeypatch, dynamic: Trust, in_misfit: bool, simpler: Trust | None, chosen: str
) -> None:
    """Without a misfit, the thrust table or number of poles is to blame, on which simpler methods depend as well."""
    verdicts = {"dynamic": dynamic, "simpler": simpler}
    flight = SimpleNamespace(
        aircraft=None, propeller=None, trajectory=None, drag=None, progress=lambda _: None, method="dynamic"
    )
    for step in ("recorded", "synchronized", "with_runs", "reconstructed", "estimated"):
        monkeypatch.setattr(pipeline, step, lambda *_, **__: flight)
    monkeypatch.setattr(pipeline, "whole_flight", lambda *_: None)
    monkeypatch.setattr(pipeline, "misfit", lambda _: {"height": 2.7} if in_misfit else {})
    monkeypatch.setattr(pipeline, "as_measured", lambda *_: flight)
    other = None if simpler is None else SimpleNamespace(method="simpler")
    monkeypatch.setattr(pipeline, "by_simpler_method", lambda *_: other)
    monkeypatch.setattr(
        pipeline, "_analysis",
        lambda item, *_: SimpleNamespace(method=item.method, results=SimpleNamespace(trust=verdicts[item.method])),
    )  # fmt: skip
    nothing: Any = None
    assert pipeline.analyze_runs(nothing).method == chosen  # type: ignore[attr-defined]


def test_an_interval_is_compared_over_the_lift_coefficients_of_both_curves() -> None:
    """An interval that is wide at small lift coefficients can still be the narrower where both curves were flown."""
    other = Polar(GOOD, np.diag([1e-4, 0, 0])), (0.5, 1.5)
    assert narrower((Polar(GOOD, np.diag([0.25e-4, 0, 0])), (0.2, 1.0)), other)
    assert not narrower((Polar(GOOD, np.diag([4e-4, 0, 0])), (0.2, 1.0)), other)
    by_lift = Polar(GOOD, np.array([[4e-4, -4e-4, 0], [-4e-4, 4.04e-4, 0], [0, 0, 0]]))  # smallest error near CL = 1
    assert narrower((by_lift, (0.2, 1.0)), (Polar(GOOD, np.diag([1.2e-4, 0, 0])), (0.5, 1.5)))
    assert not narrower((by_lift, (0.2, 0.4)), other), "no lift coefficient in common"


def test_at_noon_the_updraft_is_larger_without_a_trajectory_too(flown, path, monkeypatch) -> None:
    monkeypatch.setattr(flight, "trajectory_with", trajectory_or_error(path))
    maneuvers = find(flown.table, flown.still)
    propeller = load_propeller(AIRCRAFT.propulsion.propeller)
    record = flight_record(flown.table, path, maneuvers.maneuvers, AIRCRAFT, propeller)
    updraft_mps = []
    for sun_deg in (-5, 60):
        monkeypatch.setattr(flight, "sun_over", lambda fix, sun_deg=sun_deg: np.radians(sun_deg))
        result = flight.reconstructed(record)
        assert result.trajectory.as_measured
        updraft_mps.append(result.trajectory.eddies_mps)
        assert result.trajectory.prior_standard_error("updraft") == result.aircraft.uncertainty.updraft_mps
    assert updraft_mps[0] == 0 and updraft_mps[1] > 10 * AIRCRAFT.uncertainty.updraft_mps


def trajectory_or_error(path):
    """Return a stand-in for `trajectory_with` that gives only the path as measured, and otherwise raises InputError."""

    def trajectory_with(record, data, *, as_measured: bool = False, **assumed):
        if as_measured:
            return path
        raise InputError("no trajectory")

    return trajectory_with
