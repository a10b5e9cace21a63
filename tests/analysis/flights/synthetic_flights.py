"""Synthetic statistics of flights: draws from the model that the joint estimate assumes.

Two steps, as in an analysis: the errors of the installation with their prior; then drag and thrust for these, with the
prior of thrust, whose effect is not fed back to the first step.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.flights.flight_statistics import POOLED, M
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.records.flight import POOLING_FORMAT as FORMAT

Array = NDArray[np.float64]

POLAR = np.array([0.0465, -0.0195, 0.065])
PRIOR_SIGMA = np.array([np.inf] * 3 + [0.018, 0.15, 1.0, 0.0175, 0.03, 0.0175, 0.0125, 0.012])
PRIOR_MEAN = np.r_[np.zeros(M - 1), 0.006]  # a lag, as latency has one
# Standard deviations of one flight in turbulence, given the shared errors: polar, thrust, installation.
NOISE = np.array([3e-4, 9e-4, 6e-4, 0.006, 0.04, 0.5, 0.005, 0.02, 0.01, 0.006, 0.004])
# Change of the polar per unit of thrust scale, thrust slope and errors of the installation.
BY_OTHERS = np.zeros((3, M))
BY_OTHERS[:, 3:] = np.array(
    [
        [0.04, 0.002, 1e-4, -0.01, 0.004, 0, 0.03, 0.01],
        [0.00, 0.001, 0, 1.0, 0.010, 0, 0.02, 0.02],
        [0.02, 0.002, 1e-4, 0.05, 0.06, 0, 0.05, 0.03],
    ]
)
# Change of thrust scale and slope by the errors of the installation: drag and thrust are distinguished by airspeed.
THRUST_BY_ERRORS = np.array([[0, 0, 0, -0.26, 0.30], [0.1, 0, 0, -1.45, 0.19], [0, 0, 0, 0, 0]])
CHANGES = {"weight": np.r_[1e-4, -4e-5, 1.2e-4, 2e-3, np.zeros(M - 4)]}


def truth(rng: np.random.Generator, polar: Array = POLAR) -> Array:
    """Shared parameters (M,) drawn from their priors."""
    return np.concatenate([polar, PRIOR_MEAN[3:] + PRIOR_SIGMA[3:] * rng.standard_normal(M - 3)])


def flight(x: Array, rng: np.random.Generator, name: str, noise: float = 1.0, **facts: Any) -> dict[str, Any]:
    """The results of a flight with the shared parameters x. Its covariance, priors included, is exact.

    noise : factor on the standard deviations     facts : replace `installation`, `aircraft`, `prior_sigma`, ...;
    `stand` is a measurement of thrust before the flight, as `results.json` has it; `color` is the ratio of the errors
    of drag and thrust to those that their weights assume, as with colored residuals
    """
    sigma = facts.get("prior_sigma", PRIOR_SIGMA)
    P = np.diag(sigma**-2.0)
    vector, measured = P @ PRIOR_MEAN, [facts["stand"]] if "stand" in facts else []
    for stand in measured:
        h = np.array([stand["coefficients"].get(key, 0.0) for key in POOLED]) / stand["sigma"]
        P, vector = P + np.outer(h, h), vector + h * stand["value"] / stand["sigma"]
    color = facts.get("color", 1.0)
    first, second = slice(6, M), slice(0, 6)
    error = noise * NOISE * rng.standard_normal(M)
    error[second] *= color
    data_information = np.diag((noise * NOISE) ** -2.0)
    C_first = np.linalg.inv(data_information[first, first] + P[first, first])
    errors = C_first @ (data_information[first, first] @ (x + error)[first] + vector[first])
    # Drag shows A plus BY_OTHERS times the errors of thrust and installation; thrust shows itself.
    J = np.eye(6)
    J[:3, 3:] = BY_OTHERS[:, 3:6]
    whitened = np.diag(1 / (noise * NOISE[second])) @ np.linalg.inv(J)
    by_errors = np.vstack([BY_OTHERS[:, 6:], THRUST_BY_ERRORS])
    C_second = np.linalg.inv(whitened.T @ whitened + P[second, second])
    shown = x[second] + by_errors @ (errors - x[first]) + J @ error[second]
    drag = C_second @ (whitened.T @ whitened @ shown + vector[second])
    slope = C_second @ whitened.T @ whitened @ by_errors
    weighting = C_second
    C_second = weighting @ (color**2 * whitened.T @ whitened + P[second, second]) @ weighting
    S = np.block([[C_second + slope @ C_first @ slope.T, slope @ C_first], [C_first @ slope.T, C_first]])
    S = (S + S.T) / 2
    total = S[:3, :3] + covariance.floor() + sum(np.outer(c[:3], c[:3]) for c in CHANGES.values())
    return {
        "log": f"{name}.mcap",
        "trust": "trusted",
        "evidence": [],
        "aircraft": {
            "name": facts.get("aircraft", "mine"),
            "title": "Mine",
            "wing_area_m2": 0.46,
            "span_m": 1.75,
            "propeller": facts.get("propeller", "apc-12x8e"),
        },
        "test": {"weight_N": 37.7, "air_density_kgpm3": 1.2},
        "air_temperature_K": facts.get("temperature_K", 288.0),
        "pooling": {
            "format": FORMAT,
            "names": list(POOLED),
            "values": [*drag.tolist(), *errors.tolist()],
            "covariance": [row[: i + 1] for i, row in enumerate(S.tolist())],
            "weighting_covariance": [row[: i + 1] for i, row in enumerate(weighting.tolist())],
            "prior_mean": PRIOR_MEAN.tolist(),
            "prior_sigma": [s if np.isfinite(s) else None for s in sigma.tolist()],
            **({"prior_measurements": measured} if measured else {}),
            "changes": {key: change.tolist() for key, change in CHANGES.items()},
            "polar_covariance": total.tolist(),
            "flown_CL": [0.25, 1.0],
            "installation": facts.get("installation", "boom"),
            "propeller_table": facts.get("propeller", "apc-12x8e"),
            "probe_calibration": "tunnel",
            "start_unix_s": facts.get("start_unix_s"),
            "battery_V": None,
        },
    }
