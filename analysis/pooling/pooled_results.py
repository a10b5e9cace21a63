"""The pooled results.json (docs/pooling.md).

The pool of several flights, from their results.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.noise import NORMAL_95
from analysis.polar import Polar, lift_coefficient, power_required
from analysis.pooling.agreement import (
    differences_in_pool,
    flights_covariance,
    likely_reason,
)
from analysis.pooling.comparison import DIFFERENCES_TO_SEE, flights_to_see
from analysis.pooling.flight_statistics import (
    INSTALLATION,
    POLAR,
    THRUST,
    FlightStatistics,
    check_one_aircraft,
    read_statistics,
)
from analysis.pooling.joint import pooled_estimate, shared_prior, stacked
from analysis.pooling.joint_pool import JointPool, mean_condition, pooled_polar, trends
from analysis.results.trust import NOT_TO_TRUST
from flight.errors import InputError

Array = NDArray[np.float64]

FORMAT = "flightpower-pooled-1"
HOMOGENEITY_LEVEL = 0.05
_N_POLAR = len(POLAR)


def pooled_json(pooled: JointPool) -> dict[str, Any]:
    """Plain values only. Percentages are of the pooled power required."""
    results = pooled.flights[0].results
    names = POLAR + THRUST + INSTALLATION
    error = np.sqrt(np.diag(pooled.estimate.total))
    flights = _flights(pooled)
    return {
        "format": FORMAT,
        "software_version": version("flightpower"),
        "aircraft": dict(results["aircraft"]),
        "installation": pooled.flights[0].installation,
        "test": {"weight_N": pooled.condition.weight_N, "air_density_kgpm3": pooled.condition.rho},
        "drag_polar": dict(zip(POLAR, pooled.polar.A.tolist(), strict=True)),
        "polar_covariance": pooled.polar.covariance.tolist(),
        "parameters": [
            {"name": name, "value": float(x), "standard_error": float(e), "unit": _unit(name)}
            for name, x, e in zip(names[_N_POLAR:], pooled.estimate.x[_N_POLAR:], error[_N_POLAR:], strict=True)
        ],
        "power_required": _curve(pooled),
        "between_flights": _between_flights(pooled),
        "homogeneity": _homogeneity(pooled),
        "installation_homogeneity": _installation_homogeneity(pooled),
        "flights": flights,
        "outliers": [
            {"log": flight["log"], "p": min(flight["p"], flight["p_installation"]), "reason": flight["reason"]}
            for flight in flights
            if flight["outlier"]
        ],
        "one_more": _one_more(pooled, flights),
        "flights_to_see": [
            {"difference_percent": 100 * share, "flights_each": flights_to_see(pooled, share)}
            for share in DIFFERENCES_TO_SEE
        ],
        "trends": [trend._asdict() for trend in _trends(pooled)],
        "notes": _notes(pooled),
    }


def _unit(name: str) -> str:
    return {"alpha_bias": "rad", "beta_bias": "rad", "air_data_lag": "s"}.get(name, "")


def _curve(pooled: JointPool) -> list[dict[str, Any]]:
    V = pooled.curve_speeds_mps
    power, error = pooled.power(V)
    half = NORMAL_95 * error
    known = _thrust_known(pooled, lift_coefficient(V, pooled.condition))
    return [
        {"speed_mps": v, "power_W": p, "power_lo_W": p - h, "power_hi_W": p + h, "extrapolated": not sure}
        for v, p, h, sure in zip(V.tolist(), power.tolist(), half.tolist(), known, strict=True)
    ]


def _thrust_known(pooled: JointPool, CL: Array) -> list[bool]:
    """Whether the propeller's table covers the thrust of at least one flight that covers this lift coefficient."""
    known = np.zeros(len(CL), dtype=bool)
    for flight in pooled.flights:
        points = flight.results.get("power_required") or []
        low, high = flight.flown_CL
        inside = (CL >= low * (1 - 1e-9)) & (CL <= high * (1 + 1e-9))
        if not points:
            known |= inside
            continue
        own = lift_coefficient(np.array([point["speed_mps"] for point in points]), flight.condition)
        nearest = np.abs(own[:, None] / CL - 1).argmin(axis=0)
        sure = np.array([not point["extrapolated"] for point in points])
        known |= inside & sure[nearest]
    return [bool(k) for k in known]


def _percent(pooled: JointPool, V: Array) -> Array:
    """Derivative (n, 3) of the power at V by the polar, in percent of the pooled power."""
    zero = np.zeros((3, 3))
    power, _ = pooled.power(V)
    rows = [power_required(V, Polar(row, zero), pooled.condition)[0] for row in np.eye(3)]
    return np.asarray(100 * np.stack(rows, axis=1) / power[:, None])


def _deviations(pooled: JointPool) -> list[tuple[Array, Array]]:
    """Of each flight's curve from the pooled one: percent and 95 % limits, each (n,), at `speeds_mps`."""
    if len(pooled.flights) == 1:
        return [(np.zeros(len(pooled.speeds_mps)), np.zeros(len(pooled.speeds_mps)))]
    J = _percent(pooled, pooled.speeds_mps)
    found = []
    for difference in differences_in_pool(pooled.stack, pooled.estimate):
        value, C = J @ difference.value[:_N_POLAR], difference.covariance[:_N_POLAR, :_N_POLAR]
        found.append((value, NORMAL_95 * np.sqrt(np.maximum(np.einsum("vi,ij,vj->v", J, C, J), 0.0))))
    return found


def _between_flights(pooled: JointPool) -> list[dict[str, float]]:
    """Scatter of the flights' curves about the pooled one, and what their errors explain of it."""
    if len(pooled.flights) == 1:
        return []
    value, limit = (np.array(part) for part in zip(*_deviations(pooled), strict=True))
    observed, expected = np.sqrt(np.mean(value**2, axis=0)), np.sqrt(np.mean((limit / NORMAL_95) ** 2, axis=0))
    excess = np.sqrt(np.maximum(observed**2 - expected**2, 0.0))
    return [
        {"speed_mps": v, "observed_percent": o, "expected_percent": e, "excess_percent": x}
        for v, o, e, x in zip(
            pooled.speeds_mps.tolist(), observed.tolist(), expected.tolist(), excess.tolist(), strict=True
        )
    ]


def _homogeneity(pooled: JointPool) -> dict[str, Any] | None:
    test = pooled.homogeneity
    if test is None:
        return None
    text = (
        f"The flights differ by more than their errors explain (p = {test.p:.2g}): the interval of the pooled curve may"
        " be too narrow. Look at the outliers and trends: something changed between flights, or an error is larger than"
        " assumed."
        if test.p < HOMOGENEITY_LEVEL
        else f"The flights agree within their errors (p = {test.p:.2g})."
    )
    return {**test._asdict(), "text": text}


def _installation_homogeneity(pooled: JointPool) -> dict[str, Any] | None:
    test = pooled.installation_homogeneity
    if test is None:
        return None
    text = (
        f"The errors of the installation differ between flights (p = {test.p:.2g}): probe, tubes or tray were moved."
        " Give the flights before and after different [installation] names, or none."
        if test.p < HOMOGENEITY_LEVEL
        else f"The errors of the installation are the same in all flights within their errors (p = {test.p:.2g})."
    )
    return {**test._asdict(), "text": text}


def _flights(pooled: JointPool) -> list[dict[str, Any]]:
    n, V = len(pooled.flights), pooled.speeds_mps
    half = pooled.half_widths_percent([1] * n, V)
    without = pooled.half_widths_without_percent(V) if n > 1 else np.full((1, len(V)), np.inf)
    gains = np.mean(half**-2 - without**-2, axis=1)
    shares = np.maximum(gains, 0) / np.maximum(gains, 0).sum()
    found = []
    for i, (flight, (value, limit)) in enumerate(zip(pooled.flights, _deviations(pooled), strict=True)):
        difference = pooled.outliers.get(i) or (pooled.differences[i] if pooled.differences else None)
        found.append(
            {
                "log": flight.name,
                "installation": flight.installation,
                "test": {"weight_N": flight.condition.weight_N, "air_density_kgpm3": flight.condition.rho},
                "drag_polar": dict(zip(POLAR, flight.values[:_N_POLAR].tolist(), strict=True)),
                "half_width_percent": pooled.half_widths_percent([int(j == i) for j in range(n)], V).tolist(),
                "half_width_without_percent": without[i].tolist() if n > 1 else None,
                "share_of_information": float(shares[i]),
                "against_pool": [
                    {"speed_mps": v, "difference_percent": d, "limit_percent": m}
                    for v, d, m in zip(V.tolist(), value.tolist(), limit.tolist(), strict=True)
                ],
                "p": difference.p if difference else None,
                "p_installation": difference.p_installation if difference else None,
                "outlier": i in pooled.outliers,
                "reason": likely_reason(pooled.outliers[i]) if i in pooled.outliers else "",
            }
        )
    return found


def _one_more(pooled: JointPool, flights: list[dict[str, Any]]) -> dict[str, Any]:
    """Half widths now, and with one more flight like the one that contributed most."""
    V, n = pooled.speeds_mps, len(flights)
    best = int(np.argmax([flight["share_of_information"] for flight in flights]))
    return {
        "like": flights[best]["log"],
        "speed_mps": V.tolist(),
        "half_width_percent": pooled.half_widths_percent([1] * n, V).tolist(),
        "half_width_then_percent": pooled.half_widths_percent([1 + (j == best) for j in range(n)], V).tolist(),
    }


def _trends(pooled: JointPool) -> list[Any]:
    """At the speed where the flights alone are most certain."""
    n = len(pooled.flights)
    J = _percent(pooled, pooled.speeds_mps)
    C = flights_covariance(pooled.stack, pooled.estimate)
    blocks = C.reshape(n, 3, n, 3)
    at = int(np.argmin(np.einsum("vi,figj,vj,fg->v", J, blocks, J, np.eye(n), optimize=True)))
    deviations = np.array([J[at] @ (flight.values[:_N_POLAR] - pooled.polar.A) for flight in pooled.flights])
    return trends(pooled.flights, deviations, np.einsum("i,figj,j->fg", J[at], blocks, J[at]))


def _notes(pooled: JointPool) -> list[str]:
    notes = []
    if len(pooled.flights) > 1 and not pooled.flights[0].installation:
        notes.append(
            "The aircraft file has no [installation] name: the probe is taken to be mounted anew for each flight. Give"
            " flights between which nothing was moved one name."
        )
    for flight in pooled.flights:
        notes += [f"{flight.name} is not to be trusted. {reason}" for reason in flight.results.get(NOT_TO_TRUST, [])]
    for found in (_homogeneity(pooled), _installation_homogeneity(pooled)):
        if found and found["p"] < HOMOGENEITY_LEVEL:
            notes.append(found["text"])
    return notes


@dataclass(frozen=True)
class PooledResult(JointPool):
    """The pool, and the form of its results.json."""

    def to_json(self) -> dict[str, Any]:
        """The content of the pooled results.json (docs/pooling.md)."""
        return pooled_json(self)


def pool_results(results: Sequence[Path | Mapping[str, Any]]) -> PooledResult:
    """The joint estimate of flights, from the results.json of each.

    Raises InputError for none, for results without statistics, for one flight twice, and for flights of two aircraft,
    propellers or installations.
    """
    if not results:
        raise InputError("no flights to pool; give the results.json of one or more flights")
    return pool([read_statistics(one) for one in results])


def pool(flights: Sequence[FlightStatistics]) -> PooledResult:
    """The same from the statistics of the flights."""
    _refuse_repeated(flights)
    check_one_aircraft(flights)
    stack, prior = stacked(flights), shared_prior(flights)
    estimate = pooled_estimate(stack, prior)
    return PooledResult(
        flights=tuple(flights),
        stack=stack,
        prior=prior,
        estimate=estimate,
        polar=pooled_polar(flights, estimate),
        condition=mean_condition(flights),
        flown_CL=(min(f.flown_CL[0] for f in flights), max(f.flown_CL[1] for f in flights)),
    )


def _refuse_repeated(flights: Sequence[FlightStatistics]) -> None:
    seen: dict[bytes, str] = {}
    for flight in flights:
        key = flight.values.tobytes()
        if key in seen:
            raise InputError(
                f"{flight.name} and {seen[key]} are the same flight: their estimates are equal to the digit; give each"
                " flight once"
            )
        seen[key] = flight.name
