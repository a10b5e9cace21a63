"""Synthetic statistics of flights: draws from the model that the joint estimate assumes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.drag import covariance
from analysis.pooling.flight_statistics import POOLED, M
from analysis.results.pooling_statistics import FORMAT

Array = NDArray[np.float64]

POLAR = np.array([0.0465, -0.0195, 0.065])
PRIOR_SIGMA = np.array([np.inf] * 3 + [0.018, 0.15, 1.0, 0.0175, 0.03, 0.0175, 0.0125, 0.012])
PRIOR_MEAN = np.r_[np.zeros(M - 1), 0.006]  # a lag, as latency has one
# Of one flight in turbulence, for given shared errors: polar, thrust, installation.
NOISE = np.array([3e-4, 9e-4, 6e-4, 0.006, 0.04, 0.5, 0.005, 0.02, 0.01, 0.006, 0.004])
# Change of the polar by one unit of thrust scale, thrust slope and errors of the installation.
BY_OTHERS = np.zeros((3, M))
BY_OTHERS[:, 3:] = np.array(
    [
        [0.04, 0.002, 1e-4, -0.01, 0.004, 0, 0.03, 0.01],
        [0.00, 0.001, 0, 1.0, 0.010, 0, 0.02, 0.02],
        [0.02, 0.002, 1e-4, 0.05, 0.06, 0, 0.05, 0.03],
    ]
)
CHANGES = {"weight": np.r_[1e-4, -4e-5, 1.2e-4, 2e-3, np.zeros(M - 4)]}


def truth(rng: np.random.Generator, polar: Array = POLAR) -> Array:
    """Shared parameters (M,) drawn from their priors."""
    return np.concatenate([polar, PRIOR_MEAN[3:] + PRIOR_SIGMA[3:] * rng.standard_normal(M - 3)])


def flight(x: Array, rng: np.random.Generator, name: str, noise: float = 1.0, **facts: Any) -> dict[str, Any]:
    """The results of a flight with the shared parameters x. Its posterior, prior included, is exact.

    noise : factor on the standard deviations     facts : replace `installation`, `aircraft`, `prior_sigma`, ...
    """
    sigma = facts.get("prior_sigma", PRIOR_SIGMA)
    J = np.eye(M)
    J[:3] += BY_OTHERS
    whitened = np.diag(1 / (noise * NOISE)) @ np.linalg.inv(J)
    information, P = whitened.T @ whitened, np.diag(sigma**-2.0)
    data = whitened @ x + rng.standard_normal(M)
    S = np.linalg.inv(information + P)
    S = (S + S.T) / 2
    total = S[:3, :3] + covariance.floor() + sum(np.outer(c[:3], c[:3]) for c in CHANGES.values())
    return {
        "log": f"{name}.mcap",
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
            "values": (S @ (whitened.T @ data + P @ PRIOR_MEAN)).tolist(),
            "covariance": [row[: i + 1] for i, row in enumerate(S.tolist())],
            "prior_mean": PRIOR_MEAN.tolist(),
            "prior_sigma": [s if np.isfinite(s) else None for s in sigma.tolist()],
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
