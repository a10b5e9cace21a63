"""All methods on one flight, each run alone, and the pairs of methods that disagree."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from analysis.drag.comparison import MethodDisagreement, disagreements
from analysis.drag.direct import ACCELERATIONS, DECELERATIONS, DIRECT, FROM_SPEED, ONE_RUN, VARIED_LIFT
from analysis.drag.dynamic import DynamicEstimate
from analysis.drag.energy import ENERGY
from analysis.drag.forces import FlightForces
from analysis.drag.method import Method, MethodEstimate, estimate
from analysis.drag.method_inputs import method_inputs
from analysis.drag.piw_viw import PIW_VIW_THREE, PIW_VIW_TWO
from analysis.drag.polar import Condition
from analysis.drag.sensor_errors import estimate_errors
from analysis.drag.w_delta import W_DELTA, W_DELTA_SLOW
from analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.propeller import Propeller

ALL_METHODS: tuple[Method, ...] = (
    PIW_VIW_THREE, PIW_VIW_TWO, W_DELTA, W_DELTA_SLOW, DIRECT, FROM_SPEED, VARIED_LIFT, ENERGY, ACCELERATIONS,
    DECELERATIONS,
)  # fmt: skip


class MethodEstimates(NamedTuple):
    """The estimates of all methods; one_by_one: of each acceleration and deceleration alone."""

    by_method: list[MethodEstimate]
    one_by_one: list[MethodEstimate]
    disagreements: list[MethodDisagreement]


def every_method(
    trajectory: Trajectory,
    runs: list[Maneuver],
    dynamic: DynamicEstimate | None,
    dynamic_CL: tuple[float, float],
    aircraft: Aircraft,
    propeller: Propeller,
    condition: Condition,
) -> MethodEstimates:
    """ALL_METHODS on the runs of any kind, each run alone, and the pairs that disagree at one weight and density.

    dynamic: None where the flight has no run for it. dynamic_CL: its lift coefficients.
    """
    flight_forces = FlightForces(trajectory, aircraft, propeller)
    t = flight_forces.t_s
    level = [run for run in runs if run.kind in LEVEL_RUNS]
    in_level_runs = np.zeros(len(t), dtype=bool)
    for run in level:
        in_level_runs |= (t >= run.start_s) & (t <= run.end_s)
    errors = estimate_errors(flight_forces, trajectory, in_level_runs)
    inputs = method_inputs(flight_forces, trajectory, runs, errors)
    by_method = [estimate(method, inputs) for method in ALL_METHODS]
    one_by_one = [estimate(replace(ONE_RUN, title=run.name), replace(inputs, runs=[run])) for run in level]
    return MethodEstimates(by_method, one_by_one, disagreements(dynamic, dynamic_CL, by_method, errors, condition))
