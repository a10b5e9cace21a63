"""Simulates flights as the analysis receives them, without buses, counts or log, for benchmarks and tests."""

import contextlib
import dataclasses
import json
import pickle
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from flightpower.analysis.air.air import air_data, specific_force_at_cg
from flightpower.analysis.air.probe import ProbeCalibration
from flightpower.analysis.air.transducers import CHANNELS, Plateau, TransducerCalibration
from flightpower.analysis.calibrations.probe import calibrate, read_tunnel
from flightpower.analysis.calibrations.transducers import calibrate as calibrate_transducers
from flightpower.analysis.sources.daemon import speed_scale
from flightpower.analysis.sources.rest import Zeros, rest_segments, without_zeros, zeros
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.runs import flying_Pa
from flightpower.flight.units import KNOT_MPS
from flightpower.sim.bench import ColumnSegment
from flightpower.sim.fly import Flight, fly
from flightpower.sim.plan import Plan, load_plan
from flightpower.sim.plant import plant_of
from flightpower.sim.sensors import FlightSensorTruth, draw
from flightpower.sim.sensors.budget import DrawnErrors, ErrorBudget
from flightpower.sim.trim import Trimmer
from flightpower.sim.tunnel import simulated_measurements, write_calibration
from flightpower.sim.world import load_world

Job = TypeVar("Job")
Key = tuple[Any, ...]
Line = dict[str, Any]

# Errors of the water column, 1 sigma: its scale, as `calibrate transducers` assumes, and 0.3 mm of each reading.
COLUMN = "transducer-column"
COLUMN_SCALE, READING_PA = 0.005, 3.0
PLATEAU_SAMPLES = 175
TICK_S, FIFO_S, SAMPLES = 0.04, 0.005, 8
GPS_S = 0.1
HEIGHT_M = 40.0  # height of the whole test flight


@lru_cache(maxsize=1)
def tunnel_probe() -> ProbeCalibration:
    """Return a probe calibrated in the simulated tunnel; it is the same for every flight."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tunnel.csv"
        write_calibration(path, simulated_measurements(seed=0), replace=False)
        return calibrate(read_tunnel(path), "tunnel.csv")


def draw_errors(budget: ErrorBudget, seed: int) -> DrawnErrors:
    """Draw one day's errors without vibration, which needs the part's own low-pass filter and thus the whole chain."""
    return draw(dataclasses.replace(budget, noise=dataclasses.replace(budget.noise, vibration_mps2=0.0)), seed)


def stall_mps(aircraft: Aircraft) -> float:
    """Return the stall speed at the height of the whole test flight [m/s]."""
    return Trimmer(plant_of(aircraft), HEIGHT_M).V_stall


class Setup(NamedTuple):
    """One flight of a study to simulate and analyze."""

    aircraft: str
    world: str  # name of a world or an error budget
    plan: str
    turbulence_kt: float
    seed: int

    @property
    def drawn_errors(self) -> DrawnErrors:
        """Errors drawn for the flight's day."""
        return draw_errors(load_world(self.world).errors, self.seed)


# One flight's errors and half the 95 % intervals, by title, % of the truth (2, columns); NaN without a value.
Rows = list[tuple[str, np.ndarray]]


class Flown(NamedTuple):
    """A simulated flight and what its sensors measure, errors included."""

    flight: Flight
    sensor_truth: FlightSensorTruth
    table: pd.DataFrame  # as from `analysis.sources.daemon.synchronize`


def flown(
    aircraft: Aircraft,
    errors: DrawnErrors,
    plan_name: str | Path,
    seed: int,
    turbulence_kt: float = 0.0,
    *,
    wind_too: bool = False,
) -> Flown:
    """Fly a plan. Turbulence of W20, unless 0, replaces the plan's. The caller may change the table.

    wind_too : W20 also sets the mean wind at 20 ft, even if it is 0

    The last flights are cached, because flying takes most of the time of many tests, so the truth must not be changed.
    """
    plan = load_plan(plan_name)
    if turbulence_kt:
        plan = dataclasses.replace(plan, air=dataclasses.replace(plan.air, turbulence_mps=turbulence_kt * KNOT_MPS))
    if wind_too:
        plan = dataclasses.replace(plan, air=dataclasses.replace(plan.air, wind_mps=turbulence_kt * KNOT_MPS))
    flight = _flown(pickle.dumps((aircraft, errors, plan, seed)))
    return flight._replace(table=flight.table.copy())


@lru_cache(maxsize=4)
def _flown(arguments: bytes) -> Flown:
    """Fly with pickled arguments; the cache needs them pickled because they have no hash."""
    aircraft, errors, plan, seed = pickle.loads(arguments)
    flight, table = fly_and_measure(aircraft, errors, plan, seed)
    return Flown(flight, FlightSensorTruth(flight, errors), table)


def fly_and_measure(aircraft: Aircraft, errors: DrawnErrors, plan: Plan, seed: int) -> tuple[Flight, pd.DataFrame]:
    """Return the flight and the table of its sensors. Tests get both from their corpus (tests/corpus.py)."""
    flight = fly(aircraft, plan, seed=seed, deviations=errors.deviations)
    return flight, sensor_table(FlightSensorTruth(flight, errors), aircraft)


def sensor_table(sensor_truth: FlightSensorTruth, aircraft: Aircraft) -> pd.DataFrame:
    """Return the table that `analysis.sources.daemon.synchronize` would make from the flight's log, without
    quantization and jitter."""
    t = np.arange(0, sensor_truth.duration_s, TICK_S)
    fine = (t[:, None] + (np.arange(SAMPLES) - (SAMPLES - 1) / 2) * FIFO_S).ravel()
    force, rate = (values.reshape(-1, SAMPLES, 3).mean(axis=1) for values in sensor_truth.imu(fine))
    table = {f"a{axis}_mps2": force[:, i] for i, axis in enumerate("xyz")}
    table |= {f"{axis}_radps": rate[:, i] for i, axis in enumerate("pqr")}
    for name, column in (("alpha", "dp_alpha_Pa"), ("beta", "dp_beta_Pa"), ("airspeed", "q_c_Pa")):
        table[column] = sensor_truth.differential_pressure_Pa(name, t)
    table["static_Pa"] = sensor_truth.absolute_pressure_Pa("static", t)
    table["static_temperature_K"] = sensor_truth.transducer_temperature_K("static", t)
    table["n_revps"] = sensor_truth.motor_speed_revps(t)
    pulses = sensor_truth.servo_pulses_us(t)[:, aircraft.elevator.channel - 1]
    table["elevator_rad"] = np.array([aircraft.elevator.angle_of_pulse_rad(pulse) for pulse in pulses])
    times_s = np.arange(0, sensor_truth.duration_s, GPS_S)
    magnetic = sensor_truth.magnetic_field_T(t)
    table |= {f"mag_{axis}_T": magnetic[:, i] for i, axis in enumerate("xyz")}
    velocity = sensor_truth.gps(times_s).velocity_ned_mps
    for i, axis in enumerate(("north", "east", "down")):
        table[f"gps_{axis}_mps"] = CubicSpline(times_s, velocity[:, i])(t)
    return pd.DataFrame(table, index=pd.Index(t, name="t_s"))


class AirOf(NamedTuple):
    """Air data, stretches at rest, and zeros from these stretches."""

    table: pd.DataFrame
    still: list[slice]
    at_rest: Zeros | None


def air_of(table: pd.DataFrame, aircraft: Aircraft, probe: ProbeCalibration) -> AirOf:
    """Run the chain's steps up to the air data on a table as from `synchronize`."""
    scale = speed_scale(aircraft)
    still = rest_segments(table, 1 / TICK_S, flying_Pa(scale))
    at_rest = zeros(table, still, flying_Pa=flying_Pa(scale))
    corrected = specific_force_at_cg(without_zeros(table, at_rest)[0], aircraft)
    propeller = load_propeller(aircraft.propulsion.propeller)
    return AirOf(air_data(corrected, aircraft, probe, propeller, scale).table, still, at_rest)


def column_pressures() -> np.ndarray:
    """Return the pressures [Pa] in the plan `transducer-column`."""
    (segment,) = (segment for segment in load_plan(COLUMN).segments if isinstance(segment, ColumnSegment))
    return np.array(segment.pressure_Pa)


def as_read(pressures_Pa: np.ndarray, seed: int) -> list[float]:
    """Return pressures as read from a water column with errors of scale (COLUMN_SCALE) and readings (READING_PA)."""
    rng = np.random.default_rng([seed, 20])
    scale = 1 + COLUMN_SCALE * rng.standard_normal()
    return (pressures_Pa * scale + READING_PA * rng.standard_normal(len(pressures_Pa))).tolist()


def transducers_of(errors: DrawnErrors, seed: int) -> TransducerCalibration:
    """Calibrate these transducers by a water column, from the means at its plateaus."""
    e, true_Pa = errors.values, column_pressures()
    slopes = np.array([1 + e.alpha_scale, 1 + e.beta_scale, (1 + e.V_scale) ** 2])
    offsets = np.array([errors.zero[name] for name in CHANNELS])
    noise_Pa = np.array([errors.noise.alpha_Pa, errors.noise.beta_Pa, errors.noise.airspeed_Pa])
    rng = np.random.default_rng([seed, 21])
    plateaus = []
    for k, p in enumerate([0.0, *true_Pa.tolist(), 0.0]):
        means = offsets + slopes * p + noise_Pa / np.sqrt(PLATEAU_SAMPLES) * rng.standard_normal(3)
        plateaus.append(Plateau(10.0 * k, 10.0 * k + 8.0, tuple(means.tolist()), open=p == 0))
    calibration, unsupported = calibrate_transducers(plateaus, as_read(true_Pa, seed), COLUMN_SCALE, COLUMN)
    if unsupported:
        raise InputError(unsupported)
    return calibration


def known_lines(path: Path) -> list[dict[str, Any]]:
    """Return the lines of a file of flights. A last line that was cut off is left out."""
    lines = []
    for text in path.read_text("utf-8").splitlines() if path.exists() else []:
        with contextlib.suppress(ValueError):
            lines.append(json.loads(text))
    return lines


def fly_missing(
    file: Path, wanted: Mapping[Key, Job], one_flight: Callable[[Job], Line], key: Callable[[Line], Key], *, jobs: int,
    summary: Callable[[Line], str],
) -> dict[Key, Line]:  # fmt: skip
    """Return all lines of a file by key. Missing flights are flown, and each is written as a line when it is done."""
    file.parent.mkdir(parents=True, exist_ok=True)
    done = {key(line): line for line in known_lines(file)}
    missing = [job for identity, job in wanted.items() if identity not in done]
    began = time.monotonic()
    with ProcessPoolExecutor(jobs) as pool, file.open("a", encoding="utf-8") as stream:
        if stream.tell() and not file.read_text("utf-8").endswith("\n"):
            stream.write("\n")  # ends a truncated line
        running = [pool.submit(one_flight, job) for job in missing]
        for count, future in enumerate(as_completed(running), start=1):
            line = future.result()
            done[key(line)] = line
            stream.write(json.dumps(line) + "\n")
            stream.flush()
            left_min = (time.monotonic() - began) / count * (len(missing) - count) / 60
            print(f"{count}/{len(missing)}, {left_min:.0f} min left: {summary(line)}", file=sys.stderr, flush=True)
    return done


def error_rows(error: np.ndarray, half: np.ndarray) -> Iterator[tuple[str, np.ndarray, str]]:
    """Yield name, values and format of each statistic of errors (flights, speeds) and half widths of their intervals.

    NaN marks a speed that a flight does not cover; a speed covered by no flight is NaN in every row. Without half
    widths, the rows on them are missing.
    """
    finite = np.isfinite(error).any(axis=0)
    rows = [
        ("95 % of errors below", np.nanpercentile(np.abs(error[:, finite]), 95, axis=0), "{:.1f}"),
        ("mean", np.nanmean(error[:, finite], axis=0), "{:+.1f}"),
    ]
    if np.isfinite(half).any():
        covered = np.where(np.isfinite(error), np.abs(error) < half, np.nan)
        rows += [
            ("half width of intervals", np.nanmedian(half[:, finite], axis=0), "{:.1f}"),
            ("coverage, %", 100 * np.nanmean(covered[:, finite], axis=0), "{:.0f}"),
        ]
    for name, values, form in rows:
        row = np.full(len(finite), np.nan)
        row[finite] = values
        yield name, row, form
