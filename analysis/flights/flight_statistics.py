"""The statistics of one flight as arrays, read from its `results.json`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from flightpower.analysis.curve import POLAR, Condition, Curve, Polar, polar_part, stored_curve
from flightpower.analysis.records.flight import (
    AircraftResult,
    Kind,
    PerformanceResult,
    PoolingStatistics,
    PowerTrainResult,
    Results,
)
from flightpower.analysis.results.read import read_results
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

THRUST_CORRECTIONS = ("thrust_scale", "thrust_slope", "thrust_beyond")  # the last applies beyond the propeller's table
INSTALLATION_ERRORS = ("alpha_bias", "alpha_scale", "beta_bias", "V_scale", "air_data_lag")
POOLED = POLAR + THRUST_CORRECTIONS + INSTALLATION_ERRORS  # flights of one aircraft and installation share these
M = len(POOLED)


class SharedMeasurement(NamedTuple):
    """A linear combination of the shared parameters that was measured before the flights. coefficients: (M,)"""

    name: str
    coefficients: tuple[float, ...]
    value: float
    sigma: float

    @property
    def information(self) -> Array:
        """Information (M, M) of this measurement."""
        row = np.array(self.coefficients) / self.sigma
        return np.outer(row, row)

    @property
    def vector(self) -> Array:
        """The measurement's contribution (M,) to information times mean."""
        return np.array(self.coefficients) * self.value / self.sigma**2


@dataclass(frozen=True, eq=False, kw_only=True)
class _OneFlight:
    """The fields that any flight in a pool has.

    content : the flight's results.json     folder : of its report, if a dataset knows it
    """

    content: Results
    folder: str = ""

    @property
    def name(self) -> str:
        return self.content.log

    @property
    def aircraft(self) -> AircraftResult:
        return self.content.aircraft

    @property
    def start_unix_s(self) -> float | None:
        """Start of the flight's log [s, Unix time]; None if not known."""
        return self.content.start_unix_s

    @property
    def dated(self) -> bool:
        """Whether the date of the flight is known."""
        return self.start_unix_s is not None


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightStatistics(_OneFlight):
    """One flight. Arrays in the order of POOLED, (M,) or (M, M).

    parameters : the flight's own estimate; its `shared` errors are those that no residual shows
    weighting_covariance : (k, k) covariance of the first k parameters, polar and thrust, for given errors of the
        installation: its inverse weighs data and prior in the estimate. Colored residuals make `covariance` larger
    prior_mean, prior_information : prior of that estimate; the information is 0 where there is no prior
    prior_measurements : measurements that add to this prior
    polar_covariance : (3, 3) covariance of the flight's own polar
    """

    parameters: Uncertain
    weighting_covariance: Array
    prior_mean: Array
    prior_information: Array
    polar_covariance: Array
    flown_CL: tuple[float, float]
    condition: Condition
    propeller_table: str
    installation: str
    probe_calibration: str
    prior_measurements: tuple[SharedMeasurement, ...] = ()

    @property
    def battery_V(self) -> float | None:
        """Mean battery voltage over the runs; None if it was not measured."""
        return self.statistics.battery_V

    @property
    def key(self) -> bytes:
        """Equal for two files of the same flight."""
        return self.parameters.value.tobytes()

    @property
    def statistics(self) -> PoolingStatistics:
        """The statistics for pooling in the flight's results."""
        assert self.content.pooling is not None  # `of_content` requires it
        return self.content.pooling

    @property
    def polar(self) -> Polar:
        """The flight's own polar."""
        return Polar(polar_part(self.parameters.value), self.polar_covariance)

    @property
    def prior_matrix(self) -> Array:
        """Information (M, M) of the prior."""
        return sum(
            (prior_measurement.information for prior_measurement in self.prior_measurements),
            np.diag(self.prior_information),
        )

    @property
    def prior_vector(self) -> Array:
        """Information times mean (M,) of the prior."""
        return sum(
            (prior_measurement.vector for prior_measurement in self.prior_measurements),
            self.prior_information * self.prior_mean,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class FlightCurve(_OneFlight):
    """One flight that contributes its curve of electrical power to a pool, at its own weight and density."""

    curve: Curve

    @property
    def battery_V(self) -> float | None:
        return None

    @property
    def key(self) -> bytes:
        """Equal for two files of the same flight."""
        return self.curve.power_W.value.tobytes()


PoolFlight = FlightStatistics | FlightCurve


def read_curve(results: Path | Mapping[str, Any] | Results) -> FlightCurve:
    """Return a flight's curve of electrical power. Raises InputError if its results have none with statistics."""
    content = read_results(results)
    electrical = content.curves.get(Kind.ELECTRICAL)
    curve = stored_curve(electrical, content.aircraft.wing_area_m2) if electrical else None
    if curve is None:
        raise InputError(f"{content.log}: its results are of an earlier version; analyze the log again")
    return FlightCurve(content=content, curve=curve)


def read_statistics(results: Path | Mapping[str, Any] | Results) -> FlightStatistics:
    """Return the statistics of a flight, from its results.json, from its content or from what `analyze` returned.

    Raises InputError if the file cannot be read or has no statistics for pooling.
    """
    content = read_results(results)
    where = results if isinstance(results, Path) else f"results of {content.log}"
    if content.pooling is None:
        raise InputError(
            f"{where}: no statistics for pooling; analyze the log again with this version, or leave this flight out if"
            " its curve is not by the dynamic method (`methods_tried`)"
        )
    try:
        return of_content(content)
    except (ValueError, IndexError) as error:
        raise InputError(f"{where}: malformed statistics for pooling ({error}); analyze the log again") from None


def without_details(results: Results) -> Results:
    """Return the part of the results that pools and fleets use; the rest would take most of the memory."""
    use = results.use
    if use is not None:
        use = PerformanceResult(power_train=PowerTrainResult(measured=use.power_train.measured), model=use.model)
    curves = {kind: replace(curve, standard=[], interval_parts=[]) for kind, curve in results.curves.items()}
    fields = ("trust", "evidence", "software_version", "aircraft", "test", "kind", "air", "battery", "slowest_flown",
            "log", "vehicle", "drag_polar")  # fmt: skip
    origin = results.provenance and replace(results.provenance, files=[], sensors=[], events=[])
    return Results(curves=curves, use=use, provenance=origin, **{name: getattr(results, name) for name in fields})


def of_content(content: Results) -> FlightStatistics:
    """Return the statistics as arrays. Raises ValueError or IndexError if they are malformed."""
    of_flight, test = content.pooling, content.test
    if of_flight is None:
        raise ValueError("there are none")
    names, weighting = of_flight.names, of_flight.weighting_covariance
    indices = [names.index(name) for name in POOLED]
    drag = [names.index(name) for name in POLAR + THRUST_CORRECTIONS]
    sigma = np.array([np.inf if s is None else s for s in of_flight.prior_sigma])[indices]
    statistics = FlightStatistics(
        parameters=Uncertain(
            np.array(of_flight.values),
            _symmetric(of_flight.covariance, len(names)),
            {name: np.array(change) for name, change in of_flight.changes.items()},
        ).at(indices),
        weighting_covariance=_symmetric(weighting, len(weighting))[np.ix_(drag, drag)],
        prior_mean=np.array(of_flight.prior_mean)[indices],
        prior_information=sigma**-2.0,
        polar_covariance=np.array(of_flight.polar_covariance),
        flown_CL=of_flight.flown_CL,
        condition=Condition(test.weight_N, test.air_density_kgpm3, content.aircraft.wing_area_m2),
        propeller_table=of_flight.propeller_table,
        installation=of_flight.installation,
        probe_calibration=of_flight.probe_calibration,
        content=content,
        prior_measurements=tuple(
            SharedMeasurement(
                prior_measurement.name,
                tuple(prior_measurement.coefficients.get(name, 0.0) for name in POOLED),
                prior_measurement.value,
                prior_measurement.sigma,
            )
            for prior_measurement in of_flight.prior_measurements or []
        ),
    )
    finite = (
        statistics.parameters.value,
        statistics.parameters.own,
        statistics.weighting_covariance,
        statistics.polar_covariance,
    )
    if not all(np.isfinite(array).all() for array in finite):
        raise ValueError("not a finite number")
    return statistics


def _symmetric(lower_triangle: Sequence[Sequence[float]], size: int) -> Array:
    lower = np.zeros((size, size))
    for i, row in enumerate(lower_triangle):
        lower[i, : i + 1] = row
    return np.asarray(lower + np.tril(lower, -1).T)


def check_one_aircraft(flights: Sequence[FlightStatistics]) -> None:
    """Raise InputError for flights of two aircraft, propellers or installations; the message names two flights."""
    first = flights[0]
    for other in flights[1:]:
        for differs, what, values, advice in (
            (
                (first.aircraft.name, first.aircraft.wing_area_m2)
                != (other.aircraft.name, other.aircraft.wing_area_m2),
                "two aircraft",
                (first.aircraft.name, other.aircraft.name),
                "pool each alone, and compare the two pools; `flightpower fleet add` takes flights of many",
            ),
            (
                first.propeller_table != other.propeller_table,
                "two propellers, or two tables of one",
                (first.aircraft.propeller, other.aircraft.propeller),
                "pool each alone, and compare the two pools",
            ),
            (
                first.installation != other.installation,
                "two installations",
                (first.installation or "none named", other.installation or "none named"),
                "pool each alone and compare the two pools, or give both one [installation] name in the aircraft file"
                " if nothing was moved between them",
            ),
            (
                first.prior_measurements != other.prior_measurements,
                "two measurements of thrust on a stand",
                (_measured(first), _measured(other)),
                "analyze both logs with one file of `calibrate thrust` (`--thrust-stand`), or pool each alone and"
                " compare the two pools",
            ),
            (
                first.probe_calibration != other.probe_calibration,
                "two calibrations of the probe or its transducers",
                (first.probe_calibration, other.probe_calibration),
                "analyze both logs with one calibration (`--probe`, `--transducers`), or pool each alone and compare"
                " the two pools",
            ),
        ):
            if differs:
                raise InputError(
                    f"{what} in one pool: {first.name} has {values[0]}, {other.name} has {values[1]}; their errors are"
                    f" not the same; {advice}"
                )


def _measured(flight: FlightStatistics) -> str:
    return (
        ", ".join(
            f"{prior_measurement.value:+.3f} ± {prior_measurement.sigma:.3f}"
            for prior_measurement in flight.prior_measurements
        )
        or "none"
    )
