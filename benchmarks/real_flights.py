"""Flights that were flown: the curve of `analyze` against the steady points of the same flight.

python benchmarks/real_flights.py [FOLDER]: a Markdown table of errors, half widths, coverage, time and memory.
FOLDER holds `citation-reference-flight.csv.gz` (docs/real-flights.md); default: ../shared/data/real-flights.
Thrust and mass are shared by curve and reference: what is compared is how drag follows from motion.
"""

import json
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.log_contents import Replacements
from analysis.pipeline import analyze
from analysis.schema import Results
from flight.atmosphere import density, height_at, temperature_at
from flight.log_reader import Log, read_log
from flight.log_writer import LogWriter
from flight.messages import AbsolutePressure, DifferentialPressure, Imu, Message, Rpm
from flight.units import GRAVITY_MPS2 as g

Array = NDArray[np.float64]
FOLDER = Path(__file__).parents[2] / "shared" / "data" / "real-flights"
CITATION = "citation-reference-flight.csv.gz"
WEIGHT_N, WING_AREA_M2 = 62501.0, 30.0  # mean of the steady points
SPEEDS_MPS = np.arange(65.0, 136.0, 10.0)
PORT_SLOPE = 4.5  # pressure difference of an ideal probe over dynamic pressure and angle

AIRCRAFT = f"""name = "citation"
[geometry]
span = "15.911 m"
chord = "2.0569 m"
wing_area = "{WING_AREA_M2} m^2"
[mass]
weight = "{WEIGHT_N} N"
[probe]
position = ["0 m", "0 m", "0 m"]
upwash_per_CL = "0 deg"
[uncertainty]
thrust_scale = "1 %"
thrust_slope = 0.0001
"""
# A thrust column as a motor speed: one meter of diameter and a thrust coefficient of one, whatever the advance ratio.
THRUST_AS_SPEED = "# diameter_m = 1.0\nrpm,J,cT,cP\n" + "".join(
    f"{rpm},{J},1,1\n" for rpm in (100, 20000) for J in (0, 1000)
)


def vane_as_probe() -> str:
    """A calibration for pressures that are PORT_SLOPE times angle times dynamic pressure."""

    def linear(powers: list[tuple[int, int]], coefficient: float) -> dict[str, object]:
        return {"powers": powers, "coefficients": [coefficient], "residual_rms": 0.0, "order": 1}

    maps = {
        "alpha_rad": linear([(1, 0)], 1 / PORT_SLOPE),
        "beta_rad": linear([(0, 1)], 1 / PORT_SLOPE),
        "q_ratio": linear([(0, 0)], 1.0),
    }
    hull = [(-3, -3), (3, -3), (3, 3), (-3, 3)]
    head = {"format": "flightpower-probe-2", "source": "vane", "points": 1, "alpha_scale_sigma": 0.0, "hull": hull}
    return json.dumps(head | maps)


def citation_log(csv: Path, out: Path) -> Log:
    """The whole flight of the Citation as a log; the vane, the airspeed and the thrust as pressures and motor speed."""
    d = pd.read_csv(csv)
    static_Pa = 101325 * (1 - 0.0065 * d.altitude_m.to_numpy() / 288.15) ** 5.25588
    ground_Pa, ground_K = float(static_Pa[0]), float(d.static_temperature_K[0])
    height_m = height_at(static_Pa, ground_pressure_Pa=ground_Pa, ground_temperature_K=ground_K)
    rho = density(static_Pa, temperature_at(height_m, ground_K))
    q_Pa = rho * d.true_airspeed_mps.to_numpy() ** 2 / 2
    alpha_Pa = PORT_SLOPE * np.radians(d.vane_angle_of_attack_deg.to_numpy()) * q_Pa
    revps = np.sqrt(np.maximum(d.thrust_N.to_numpy(), 0.0) / rho)
    rates = np.radians(d[[f"{axis}_rate_degps" for axis in ("roll", "pitch", "yaw")]].to_numpy())
    with out.open("wb") as stream:
        log = LogWriter(stream)
        for name, text in (
            ("aircraft.toml", AIRCRAFT),
            ("propeller.csv", THRUST_AS_SPEED),
            ("probe.json", vane_as_probe()),
        ):
            log.attach(name, text.encode(), "text/plain", 0)
        for i, t_s in enumerate(d.time_s):
            messages: dict[str, Message] = {
                "/imu": Imu(
                    specific_force_x_mps2=float(d.longitudinal_specific_force_mps2[i]),
                    specific_force_y_mps2=float(d.lateral_specific_force_mps2[i]),
                    specific_force_z_mps2=float(-d.upward_specific_force_less_1g_mps2[i] - g),
                    angular_rate_x_radps=float(rates[i, 0]),
                    angular_rate_y_radps=float(rates[i, 1]),
                    angular_rate_z_radps=float(rates[i, 2]),
                ),
                "/probe/airspeed": DifferentialPressure(differential_pressure_Pa=float(q_Pa[i])),
                "/probe/alpha": DifferentialPressure(differential_pressure_Pa=float(alpha_Pa[i])),
                "/static": AbsolutePressure(
                    pressure_Pa=float(static_Pa[i]), temperature_K=float(d.static_temperature_K[i])
                ),
            }
            if revps[i] > 0:
                messages["/rpm"] = Rpm(motor_speed_revps=float(revps[i]))
            for topic, message in messages.items():
                log.write(topic, message, time_ns=round(t_s * 1e9), tick=i)
        log.finish()
    return read_log(out)


def steady_power_W(csv: Path, rho: float) -> Array:
    """Power required at SPEEDS_MPS by the flight's steady level rows: a two-term polar of drag by the energy rate."""
    d = pd.read_csv(csv)
    smooth = {name: d[name].rolling(21, center=True, min_periods=1).mean() for name in d}
    V, mass, thrust = smooth["true_airspeed_mps"], d.mass_kg, d.thrust_N
    air = 101325 * (1 - 0.0065 * smooth["altitude_m"] / 288.15) ** 5.25588 / 287.053 / d.static_temperature_K
    Vdot, climb = (np.gradient(smooth[name], d.time_s) for name in ("true_airspeed_mps", "altitude_m"))
    load = smooth["upward_specific_force_less_1g_mps2"]
    steady = (V > 55) & (np.abs(Vdot) < 0.05) & (np.abs(climb) < 2) & (d.roll_deg.abs() < 7) & (load.abs() < 0.6)
    steady &= thrust.notna() & (np.abs(np.gradient(smooth["thrust_N"].fillna(0.0), d.time_s)) < 60)
    qS = (air * V**2 / 2 * WING_AREA_M2)[steady]
    CL = (mass * (load + g))[steady] / qS
    CD = (thrust - mass * (Vdot + g * climb / V))[steady] / qS
    (CD0, K), *_ = np.linalg.lstsq(np.stack([np.ones(len(CL)), CL**2], axis=1), CD, rcond=None)
    qS_level = rho * SPEEDS_MPS**2 / 2 * WING_AREA_M2
    return np.asarray(qS_level * SPEEDS_MPS * (CD0 + K * (WEIGHT_N / qS_level) ** 2))


def row(title: str, results: Results, reference_W: Array, seconds: float) -> str:
    """One line of the table: where the curve reaches."""
    curve = results.power_required
    V = [point.speed_mps for point in curve]
    flown = (SPEEDS_MPS >= V[0]) & (SPEEDS_MPS <= V[-1])
    power, low, high = (
        np.interp(SPEEDS_MPS, V, [getattr(point, name) for point in curve])[flown]
        for name in ("power_W", "power_lo_W", "power_hi_W")
    )
    reference = reference_W[flown]
    error, half = 100 * (power / reference - 1), 100 * (high - low) / 2 / power
    inside = np.count_nonzero((low < reference) & (reference < high))
    method = results.methods_tried[-1].title
    speeds = f"{SPEEDS_MPS[flown][0]:.0f} to {SPEEDS_MPS[flown][-1]:.0f}"
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return (
        f"| {title} | {method} | {len(results.runs)} | {speeds} | {error.min():+.1f} to {error.max():+.1f} |"
        f" {half.min():.1f} to {half.max():.1f} | {inside} of {len(reference)} | {results.trust} | {seconds:.0f} |"
        f" {megabytes:.0f} |"
    )


def main(folder: Path) -> None:
    csv = folder / CITATION
    print("| flight | curve by | maneuvers | m/s | error, % | half width, % | inside | trust | s | MB |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        log = citation_log(csv, Path(scratch) / "citation.mcap")
        runs_file = Path(scratch) / "runs.toml"
        for title, kept in (("Citation II, whole flight", None), ("its decelerations alone", runs_file)):
            started = time.process_time()
            found = analyze(log, Replacements(), runs_file=kept)
            seconds = time.process_time() - started
            reference_W = steady_power_W(csv, found.condition.rho)
            print(row(title, found.results, reference_W, seconds), flush=True)
            runs_file.write_text(
                "".join(
                    f'[[run]]\nkind = "{run.kind}"\nstart = "{run.start_s:.2f} s"\nend = "{run.end_s:.2f} s"\n'
                    for run in found.maneuvers.of("deceleration")
                )
            )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
