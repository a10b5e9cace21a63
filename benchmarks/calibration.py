"""Measures the accuracy of calibrations on simulated measurements.

python benchmarks/calibration.py probe --tunnels 200
python benchmarks/calibration.py tubing --rate-Hz 25 --steps 36 --logs 60
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache, partial
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from records import Record, counted, markdown, rounded

from flightpower.analysis.air.probe import ProbeCalibration, ProbeFlow, flow_at_probe
from flightpower.analysis.air.tubing import air, low_frequency_lag_s, response
from flightpower.analysis.calibrations.probe import TunnelData, calibrate
from flightpower.analysis.calibrations.tubing import find_steps, fit_lag, through
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.flight.aircraft import PneumaticLine
from flightpower.sim.sensors.probe import port_pressures
from flightpower.sim.sensors.tubing import first_order_lag, time_constant_s
from flightpower.sim.tunnel import simulated_measurements

Array = NDArray[np.float64]
ANGLES_RAD = np.radians(np.linspace(-15, 15, 31))
QBAR_PA = 200.0
FINE_S, SIZE_PA, NOISE_PA = 2e-4, 400.0, 6.0
SEA_LEVEL = air(101_325.0, 288.15)
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def simulated_tunnel(seed: int) -> TunnelData:
    """Simulate a tunnel with its own probe and static ring: angles are set to 0.03 deg, pressures read to 0.6 Pa."""
    speed, alpha, beta, *rest = simulated_measurements(seed=seed).to_numpy().T
    return TunnelData(speed, np.radians(alpha), np.radians(beta), *rest)


def probe_errors(calibration: ProbeCalibration) -> tuple[float, float, float]:
    """Return the largest errors within +-15 deg: alpha and beta [deg], dynamic pressure [%]."""
    alpha, beta = (grid.ravel() for grid in np.meshgrid(ANGLES_RAD, ANGLES_RAD))
    flow = _measured(calibration, alpha, beta)
    of_alpha, of_beta = (np.degrees(np.max(np.abs(w))) for w in (flow.alpha_rad - alpha, flow.beta_rad - beta))
    return float(of_alpha), float(of_beta), float(100 * np.max(np.abs(flow.qbar_Pa / QBAR_PA - 1)))


def slope_error(calibration: ProbeCalibration) -> float:
    """Return the relative error of alpha's slope, from a line through estimated over true angles within +-10 deg."""
    alpha = np.radians(np.linspace(-10, 10, 41))
    return float(np.polyfit(alpha, _measured(calibration, alpha, np.zeros(41)).alpha_rad, 1)[0]) - 1


def _measured(calibration: ProbeCalibration, alpha_rad: Array, beta_rad: Array) -> ProbeFlow:
    ports = port_pressures(np.full(len(alpha_rad), QBAR_PA), alpha_rad, beta_rad)
    return flow_at_probe(calibration, ports.lower_minus_upper, ports.right_minus_left, ports.center - ports.static)


def tunnel_errors(seed: int) -> tuple[float, float, float, float, float]:
    """Return the errors of a tunnel's calibration: `probe_errors`, `slope_error`, and the stated sigma of the slope."""
    calibration = calibrate(simulated_tunnel(seed))
    return *probe_errors(calibration), slope_error(calibration), calibration.alpha_scale_sigma


def probe_records(seeds: range, jobs: int = 1) -> list[Record]:
    """Return records of the maps' errors over tunnels: the largest within +-15 deg, and that of alpha's slope."""
    with ProcessPoolExecutor(jobs) as pool:
        *worst, slopes, stated_sigma = np.array(list(pool.map(tunnel_errors, seeds))).T
    records: list[Record] = []
    for name, errors in zip(("alpha, deg", "beta, deg", "dynamic pressure, %"), worst, strict=True):
        half, most = np.percentile(errors, (50, 95))
        shares = {"median of the tunnels": half, "95 % below": most, "all below": errors.max()}
        records.append({"largest error of": name} | {title: rounded(value, 3) for title, value in shares.items()})
    half, most = np.percentile(np.abs(slopes), (50, 95))
    covered, _ = counted(np.abs(slopes) < NORMAL_95 * stated_sigma)
    return [
        *records,
        {
            "largest error of": "slope of alpha, %", "median of the tunnels": rounded(100 * half, 2),
            "95 % below": rounded(100 * most, 2), "all below": rounded(100 * np.abs(slopes).max(), 2),
            "half width": rounded(100 * NORMAL_95 * np.median(stated_sigma), 2), "coverage, %": rounded(covered),
        },
    ]  # fmt: skip


@app.command()
def probe(
    tunnels: Annotated[int, typer.Option(help="How many.")] = 200,
    seed: Annotated[int, typer.Option(help="Of the first.")] = 0,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
) -> None:
    """Print the errors of maps from simulated tunnels."""
    print(markdown(probe_records(range(seed, seed + tunnels), jobs)))


@lru_cache(maxsize=2)
def _burst(line: PneumaticLine, full: bool) -> tuple[Array, Array]:
    """Return the pressure at the transducer around a burst: it rises for 1 s, is constant for 1.5 s, drops to zero."""
    t: Array = np.asarray(np.arange(round(8 / FINE_S)) * FINE_S - 4, dtype=float)
    mouth = np.where(t < 0, SIZE_PA * np.clip(t + 2.5, 0.0, 1.0), 0.0)
    if full:
        f = np.fft.rfftfreq(len(t), FINE_S)
        H = np.where(f < 1500, response([line], np.minimum(f, 1500.0), SEA_LEVEL), 0.0)
        return t, np.fft.irfft(np.fft.rfft(mouth) * H, len(t))
    return t, np.asarray(first_order_lag(mouth, FINE_S, time_constant_s(line, SEA_LEVEL.pressure_Pa, 288.15)))


def bursts(
    line: PneumaticLine, *, full: bool, rate_Hz: float = 100.0, seed: int = 0, steps: int = 8
) -> tuple[Array, Array]:
    """Return times [s] and values [Pa] of a transducer for bursts four seconds apart, at random times between ticks.

    full: use the line's full response, which creeps and rings; otherwise a first-order lag, as in the simulator.
    """
    rng = np.random.default_rng(seed)
    instants = 3 + 4 * np.arange(steps) + rng.uniform(-0.2, 0.2, steps)
    t = np.arange(rng.uniform(0, 1 / rate_Hz), 4 * steps + 3.9, 1 / rate_Hz)
    around, pressure = _burst(line, full)
    arrived = sum(np.interp(t - instant, around, pressure, left=0.0, right=0.0) for instant in instants)
    return t, arrived + NOISE_PA * rng.standard_normal(len(t))


def bound(line: PneumaticLine, rate_Hz: float, steps: int) -> float:
    """Return the Cramér-Rao bound of the lag's relative standard error, with time and levels of each burst unknown."""
    lag_s, shape_of, small, early = low_frequency_lag_s([line], SEA_LEVEL), through(line, SEA_LEVEL), 1e-3, 1e-4
    longer, shape, shorter = (shape_of(lag_s * factor) for factor in (1 + small, 1.0, 1 - small))
    information = []
    for phase in (np.arange(400) + 0.5) / 400:
        t = (np.arange(-0.5 * rate_Hz, rate_Hz) - phase) / rate_Hz
        by_lag = (longer(t) - shorter(t)) / (2 * small)
        by_instant = (shape(t + early) - shape(t - early)) / (2 * early)
        slopes = np.stack([SIZE_PA * by_lag, SIZE_PA * by_instant, np.ones_like(t), shape(t)], axis=1)
        information.append(1 / np.linalg.inv(slopes.T @ slopes / NOISE_PA**2)[0, 0])
    return float(1 / np.sqrt(steps * np.mean(information)))


def lag_of(seed: int, diameter_mm: float, rate_Hz: float, steps: int) -> tuple[float, float, float]:
    """Return a line's lag from the bursts in a log, and the ends of its interval, all divided by the true lag."""
    line = _line(diameter_mm)
    true_s = low_frequency_lag_s([line], SEA_LEVEL)
    lag = fit_lag(
        *find_steps(*bursts(line, full=True, rate_Hz=rate_Hz, seed=seed, steps=steps)), through(line, SEA_LEVEL)
    )
    return lag.lag_s / true_s, lag.lo_s / true_s, lag.hi_s / true_s


def _line(diameter_mm: float) -> PneumaticLine:
    return PneumaticLine(length_m=0.9, diameter_m=diameter_mm * 1e-3, cavity_m3=20e-9)


def tubing_record(seeds: range, diameter_mm: float, rate_Hz: float, steps: int, jobs: int = 1) -> Record:
    """Return a record of the lag's errors over many logs, next to the Cramér-Rao bound."""
    line = _line(diameter_mm)
    with ProcessPoolExecutor(jobs) as pool:
        lag_of_seed = partial(lag_of, diameter_mm=diameter_mm, rate_Hz=rate_Hz, steps=steps)
        lags = np.array(list(pool.map(lag_of_seed, seeds)))
    lag, low, high = lags.T
    covered, counting = counted((low < 1) & (high > 1))
    return {
        "lag, ms": rounded(1e3 * low_frequency_lag_s([line], SEA_LEVEL), 1), "Hz": f"{rate_Hz:g}", "bursts": steps,
        "logs": len(seeds), "error, rms, %": rounded(100 * np.sqrt(np.mean((lag - 1) ** 2)), 1),
        "95 % below": rounded(100 * np.percentile(np.abs(lag - 1), 95), 1),
        "bound, rms, %": rounded(100 * bound(line, rate_Hz, steps), 1),
        "half width, %": rounded(100 * np.median((high - low) / (2 * lag)), 1),
        "coverage, %": rounded(covered), "±": rounded(counting, 1),
    }  # fmt: skip


@app.command()
def tubing(
    diameter_mm: Annotated[float, typer.Option("--diameter-mm", help="Of the line, 0.9 m long.")] = 0.4,
    rate_Hz: Annotated[float, typer.Option("--rate-Hz", help="Of the log.")] = 25.0,
    steps: Annotated[int, typer.Option(help="Bursts in a log.")] = 8,
    logs: Annotated[int, typer.Option(help="How many.")] = 200,
    seed: Annotated[int, typer.Option(help="Of the first.")] = 0,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
) -> None:
    """Print the errors of a line's lag from bursts of 400 Pa with 6 Pa of noise."""
    print(markdown([tubing_record(range(seed, seed + logs), diameter_mm, rate_Hz, steps, jobs)]))


if __name__ == "__main__":
    app()
