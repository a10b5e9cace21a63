"""How well calibrations find again what was simulated: the figures of docs/calibration.md.

.venv/bin/python benchmarks/calibration.py probe --tunnels 200
.venv/bin/python benchmarks/calibration.py tubing --rate-Hz 25 --steps 30 --logs 200
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse

import numpy as np
from numpy.typing import NDArray

from analysis.airdata.probe import Flow, ProbeCalibration, Tunnel, calibrate, flow_at_probe
from sim.sensors.probe import port_pressures
from sim.tunnel import calibrate as tunnel_measurements

Array = NDArray[np.float64]
ANGLES_RAD = np.radians(np.linspace(-15, 15, 31))
QBAR_PA = 200.0


def simulated_tunnel(seed: int) -> Tunnel:
    """The simulator's: angles set to 0.03 deg, pressures to 0.6 Pa; its own probe and ring of static ports."""
    speed, alpha, beta, *rest = tunnel_measurements(seed=seed).to_numpy().T
    return Tunnel(speed, np.radians(alpha), np.radians(beta), *rest)


def probe_errors(calibration: ProbeCalibration) -> tuple[float, float, float]:
    """Largest errors within +-15 deg: alpha, beta [deg], dynamic pressure [%]."""
    alpha, beta = (grid.ravel() for grid in np.meshgrid(ANGLES_RAD, ANGLES_RAD))
    flow = _measured(calibration, alpha, beta)
    of_alpha, of_beta = (np.degrees(np.max(np.abs(w))) for w in (flow.alpha_rad - alpha, flow.beta_rad - beta))
    return float(of_alpha), float(of_beta), float(100 * np.max(np.abs(flow.qbar_Pa / QBAR_PA - 1)))


def slope_error(calibration: ProbeCalibration) -> float:
    """Of a straight line through what the calibration makes of true angles of +-10 deg, less one."""
    alpha = np.radians(np.linspace(-10, 10, 41))
    return float(np.polyfit(alpha, _measured(calibration, alpha, np.zeros(41)).alpha_rad, 1)[0]) - 1


def _measured(calibration: ProbeCalibration, alpha_rad: Array, beta_rad: Array) -> Flow:
    ports = port_pressures(np.full(len(alpha_rad), QBAR_PA), alpha_rad, beta_rad)
    return flow_at_probe(calibration, ports.lower_minus_upper, ports.right_minus_left, ports.centre - ports.static)


def probe(tunnels: int) -> None:
    calibrations = [calibrate(simulated_tunnel(seed)) for seed in range(tunnels)]
    worst = np.array([probe_errors(c) for c in calibrations])
    print("largest error within +-15 deg:  in half of the tunnels, in 95 %, in all")
    for name, errors in zip(("alpha, deg", "beta, deg", "dynamic pressure, %"), worst.T, strict=True):
        half, most = np.percentile(errors, (50, 95))
        print(f"{name:20} {half:.3f} {most:.3f} {errors.max():.3f}")
    slopes = np.array([slope_error(c) for c in calibrations])
    stated = np.array([c.alpha_scale_sigma for c in calibrations])
    held = int(np.sum(np.abs(slopes) < 1.96 * stated))
    rms = 100 * np.sqrt(np.mean(slopes**2))
    print(f"slope of alpha off by {rms:.2f} % rms, {100 * np.median(stated):.2f} % stated; held {held} of {tunnels}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("probe", help="errors of the maps from simulated tunnels")
    command.add_argument("--tunnels", type=int, default=200)
    options = parser.parse_args()
    probe(options.tunnels)


if __name__ == "__main__":
    main()
