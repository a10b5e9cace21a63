"""The simulated tunnel: a file a user's own tunnel could have written, of the probe that flies."""

import csv

import numpy as np
import pytest

from flightpower.flight.errors import InputError
from flightpower.sim.sensors.probe import port_pressures
from flightpower.sim.tunnel import HEADER, WindTunnel, simulated_measurements, write_calibration


def test_the_file_has_the_agreed_header_and_a_row_a_point(tmp_path):
    path = tmp_path / "new" / "tunnel.csv"
    tunnel = WindTunnel()
    write_calibration(path, simulated_measurements(tunnel))
    with path.open(encoding="utf-8") as stream:
        header, *rows = list(csv.reader(stream))
    assert ",".join(header) == (
        "speed [m/s],alpha [deg],beta [deg],dp_alpha [Pa],dp_beta [Pa],q_c [Pa],static [Pa],temperature [K]"
    )
    n = 2 * round(tunnel.largest_angle_deg / tunnel.step_deg) + 1
    assert len(rows) == len(tunnel.speeds_mps) * n**2
    assert np.isfinite(np.array(rows, dtype=float)).all()


def test_it_is_the_probe_that_flies():
    """A perfect tunnel gives the port pressures of the flight's probe at the same dynamic pressure."""
    table = simulated_measurements(WindTunnel(pressure_noise_Pa=0.0, angle_setting_deg=0.0, speed_setting=0.0))
    speed, alpha, beta, dp_alpha, dp_beta, q_c, static, temperature = (table[name].to_numpy() for name in HEADER)
    q = static / (287.05287 * temperature) * speed**2 / 2
    ports = port_pressures(q, np.deg2rad(alpha), np.deg2rad(beta))
    assert np.allclose(dp_alpha, ports.lower_minus_upper)
    assert np.allclose(dp_beta, ports.right_minus_left)
    assert np.allclose(q_c, ports.center - ports.static)


def test_its_noise_is_what_it_says():
    tunnel = WindTunnel(angle_setting_deg=0.0, speed_setting=0.0)
    noisy, clean = (
        simulated_measurements(tunnel, seed=4),
        simulated_measurements(WindTunnel(pressure_noise_Pa=0, angle_setting_deg=0, speed_setting=0), seed=4),
    )
    for name in ("dp_alpha [Pa]", "dp_beta [Pa]", "q_c [Pa]"):
        error = (noisy[name] - clean[name]).to_numpy()
        assert np.std(error) == pytest.approx(tunnel.pressure_noise_Pa, rel=4 / np.sqrt(2 * len(error)))
    assert not simulated_measurements(seed=1).equals(simulated_measurements(seed=2))
    assert simulated_measurements(seed=1).equals(simulated_measurements(seed=1))


def test_it_does_not_overwrite(tmp_path):
    path = tmp_path / "tunnel.csv"
    path.write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        write_calibration(path, simulated_measurements())
    assert path.read_text() == "mine"
    write_calibration(path, simulated_measurements(), replace=True)
    assert path.read_text().startswith("speed")
