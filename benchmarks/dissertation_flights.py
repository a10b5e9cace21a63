"""Simulates and analyzes the flights of benchmarks/dissertation.py, and caches what the figures show of each."""

import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.curve import Condition, power_required
from flightpower.analysis.estimation import uncertainty
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.maneuvers.kinds import LEVEL_RUNS, STANDING, Maneuver, Maneuvers
from flightpower.analysis.methods import likelihood
from flightpower.analysis.pipeline.runs import Analysis, analyze_runs
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.log_reader import read_log

AIRCRAFT = {"Astraeus LS": "astraeus-ls", "Astraeus HS": "astraeus-hs", "Nexstar": "nexstar"}
WINDMILLING = "apc-12x8e-windmilling"  # table for all these flights, in which decelerations windmill
SEED = 1001
CASES = ("case-1", "case-2-returns", "case-2-higher", "case-2-lower-slowly", "case-3")
NOISE_FACTORS = (0.5, 1.0, 1.5, 3.0)
Array = np.ndarray


class FlightName(NamedTuple):
    """aircraft: a value of AIRCRAFT. noise: factor on the noise of the budget `bench`; its systematic errors stay"""

    aircraft: str
    plan: str
    noise: float = 1.0

    def __str__(self) -> str:
        return f"{self.aircraft}-{self.plan}" + ("" if self.noise == 1 else f"-noise-{self.noise:g}")


FLIGHTS = (
    *(FlightName(aircraft, plan) for aircraft in AIRCRAFT.values() for plan in ("steady-points", "two-pairs")),
    FlightName("nexstar", "throttle-step"),
    *(FlightName("nexstar", "two-pairs", noise) for noise in NOISE_FACTORS if noise != 1),
    *(FlightName(aircraft, plan) for aircraft in ("astraeus-ls", "astraeus-hs") for plan in CASES),
)


class Curve(NamedTuple):
    """Power required and half its 95 % interval [W] at speeds V, each (n,)."""

    V: Array
    power: Array
    half: Array


class RunFit(NamedTuple):
    """One run fitted alone by the two-state model.

    measured, modeled : (n,) by output     change_by_CLq : change of the response due to CLq
    estimates : name to value, standard error for white and for colored residuals
    CLq, t_CLq : from a second fit, without a prior
    """

    run: str
    t_s: Array
    curve: Curve
    measured: dict[str, Array]
    modeled: dict[str, Array]
    change_by_CLq: dict[str, Array]
    estimates: dict[str, tuple[float, float, float]]
    CLq: float
    t_CLq: float
    snr: float


class FlightFigures(NamedTuple):
    """What the figures show of one flight.

    curves : by name of method, "dynamic" included     piw_viw : PIW [W] and VIW [m/s] of steady points, and the fit
    truth : the simulator's curve     runs : name, kind, start, end     table : measured at 25 Hz in runs and at rest
    """

    name: FlightName
    curves: dict[str, Curve]
    truth: Curve
    points: Array  # (points, 4): speed, power, its interval; at the test's weight and density
    to_standard: tuple[float, float]  # factors of power and speed to PIW and VIW
    fits: list[RunFit]
    t_CLq: float  # from all runs together
    noise: dict[str, dict[str, float]]  # standard deviation of one sample by channel, by maneuver
    runs: dict[str, pd.DataFrame]


def flown(name: FlightName, folder: Path) -> Path:
    """Return the folder of the flight's log; simulate the flight if it is not there yet."""
    path = folder / str(name)
    if not (path / "log.mcap").exists():
        path.mkdir(parents=True, exist_ok=True)
        inputs = folder / f"inputs of {name}"  # a folder for each flight, because flights are flown in parallel
        inputs.mkdir(exist_ok=True)
        aircraft, errors = inputs / f"{name.aircraft}.toml", inputs / f"noise-{name.noise:g}.toml"
        text = Path("flight/data/aircraft", f"{name.aircraft}.toml").read_text("utf-8")
        aircraft.write_text(text.replace('"apc-12x8e"', f'"{WINDMILLING}"'), "utf-8")
        errors.write_text(_budget(name.noise), "utf-8")
        command = [sys.executable, "-m", "flightpower", "sim", "fly", "--replace", "--no-hardware", "--seed", str(SEED)]
        command += ["--aircraft", str(aircraft), "--plan", name.plan, "--errors", str(errors), "-o", str(path)]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    return path


def _budget(noise: float) -> str:
    """Return the error budget `bench` with its noise (Table 4.1) times a factor."""
    lines, section = [], ""
    for line in Path("sim/data/errors/bench.toml").read_text("utf-8").splitlines():
        section = line if line.startswith("[") else section
        key, equals, value = line.partition(" = ")
        if section == "[noise]" and equals:
            number, _, unit = value.strip('"').partition(" ")
            line = f'{key} = "{float(number) * noise:g} {unit}"'
        lines.append(line)
    return "\n".join(lines) + "\n"


def flight_figures(name: FlightName, folder: Path) -> FlightFigures:
    """Return what the figures show of a flight; from the cache if it has been analyzed before."""
    path = flown(name, folder)
    cache = path / "shown.pickle"
    if not cache.exists():
        flight = _flight_figures(name, path)
        cache.write_bytes(pickle.dumps(flight))
    return pickle.loads(cache.read_bytes())


def _flight_figures(name: FlightName, path: Path) -> FlightFigures:
    log = read_log(path / "log.mcap")
    analysis = analyze_runs(log, by_likelihood=True)
    aircraft, results = analysis.aircraft, analysis.results
    condition = Condition(results.test.weight_N, results.test.air_density_kgpm3, aircraft.geometry.wing_area_m2)
    truth = pd.read_csv(path / "truth_power_required.csv")
    curves = {method.name: _curve(method.power_required) for method in results.methods if method.power_required}
    curves["dynamic"] = _curve(results.power_required)
    sigma, w = condition.rho / 1.225, condition.weight_N / aircraft.mass.standard_weight_N
    points = [p for method in results.methods if method.name == "piw-viw" for p in method.points]
    table = analysis.table
    return FlightFigures(
        name,
        curves,
        Curve(truth["speed_mps"].to_numpy(), truth["power_W"].to_numpy(), np.zeros(len(truth))),
        np.array([(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in points], dtype=float),
        (sigma**0.5 / w**1.5, (sigma / w) ** 0.5),
        [_run_fit(analysis, run, condition) for run in analysis.maneuvers.level_runs],
        results.pitch_rate.t if results.pitch_rate else np.nan,
        {run.name: _noise(table.iloc[run.rows]) for run in analysis.maneuvers.of(*LEVEL_RUNS, STANDING)},
        {run.name: table.iloc[run.rows] for run in analysis.maneuvers.of(*LEVEL_RUNS, STANDING)},
    )


def _curve(points: list) -> Curve:
    V, power, hi = (np.array([getattr(p, name) for p in points]) for name in ("speed_mps", "power_W", "power_hi_W"))
    return Curve(V, power, hi - power)


CHANNELS = {"ax": "ax_mps2", "az": "az_mps2", "q": "q_radps", "alpha": "alpha_rad", "V": "V_mps"}


def _noise(rows: pd.DataFrame) -> dict[str, float]:
    return {
        name: float(np.sqrt(likelihood.sample_variance(rows[column].to_numpy()))) for name, column in CHANNELS.items()
    }


def _run_fit(analysis: Analysis, run: Maneuver, condition: Condition) -> RunFit:
    """Fit one run alone, as the source does."""
    rows = analysis.table.iloc[run.rows]
    CL = 2 * condition.weight_N / (rows["rho"] * rows["V_mps"] ** 2 * condition.wing_area_m2)
    flown_CL = tuple(float(x) for x in np.nanpercentile(CL, (2.0, 98.0)))
    alone = replace(analysis, maneuvers=Maneuvers([run]), flown_CL=flown_CL)
    estimate = likelihood.estimate(alone, (likelihood.TWO_STATE,))
    fit = estimate.fits[likelihood.TWO_STATE.name]
    without, free = (estimate.fits[name] for name in (likelihood.AS_MEASURED_FIT, likelihood.CLQ_FIT))
    V = np.linspace(
        *(np.sqrt(2 * condition.weight_N / (condition.rho * cl * condition.wing_area_m2)) for cl in flown_CL[::-1]), 40
    )
    power, error = power_required(V, estimate.methods[0].polar, condition)
    outputs = fit.model.outputs
    return RunFit(
        run.name,
        fit.segment_fits[0].segment.t_s - run.start_s,
        Curve(V, power, 1.96 * error),
        dict(fit.segment_fits[0].segment.z),
        dict(zip(outputs, fit.segment_fits[0].response.y.T, strict=True)),
        dict(zip(outputs, (free.segment_fits[0].response.y - without.segment_fits[0].response.y).T, strict=True)),
        _estimates(fit),
        estimate.pitch_rate.CLq,
        estimate.pitch_rate.t,
        estimate.pitch_rate.signal_to_noise[run.name],
    )


COEFFICIENTS = ("CL0", "CLa", "CLde", "CD0", "K", "CL_minD")


def _estimates(fit: Fit) -> dict[str, tuple[float, float, float]]:
    """Return COEFFICIENTS and their standard errors, for white residuals as in Table 7.1 and for colored residuals."""

    def function(p):
        CL_minD = -p.A1 / (2 * p.A2)
        return np.array([p.CL0, p.CLa, p.CLde, p.A0 - p.A2 * CL_minD**2, p.A2, CL_minD])

    white = uncertainty.delta_method(uncertainty.cramer_rao(fit), function)
    colored = uncertainty.delta_method(uncertainty.morelli_klein(fit), function)
    rows = zip(COEFFICIENTS, white.value, white.standard_error, colored.standard_error, strict=True)
    return {name: (float(value), float(standard_error), float(other)) for name, value, standard_error, other in rows}


def true_estimates(aircraft: str) -> dict[str, float]:
    """Return the true values of COEFFICIENTS in the simulator."""
    truth = load_aircraft(aircraft).aerodynamics
    return {name: float(truth[name]) for name in COEFFICIENTS}
