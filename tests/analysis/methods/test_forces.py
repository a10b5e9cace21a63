"""Forces along a trajectory agree with the propeller's table, the accelerometers and the definitions."""

from dataclasses import replace

import numpy as np
import pytest
from constructed import AIRCRAFT, PROPELLER, accelerations_and_decelerations, measured

from flightpower.analysis.methods.forces import FlightForces


@pytest.fixture(scope="module")
def forces() -> FlightForces:
    flight, _ = accelerations_and_decelerations()
    return FlightForces(measured(flight), AIRCRAFT, PROPELLER)


def test_thrust_along_the_path_is_that_of_the_table_over_mass(forces: FlightForces) -> None:
    f = forces.nominal
    thrust_N, _ = PROPELLER.thrust_and_power(f["V"].to_numpy(), f["n"].to_numpy(), f["rho"].to_numpy())
    wanted = thrust_N * np.cos(f["alpha"]) / AIRCRAFT.mass_kg
    assert f["thrust_along_V_over_m_mps2"].to_numpy() == pytest.approx(wanted.to_numpy())
    assert f["J"].to_numpy() == pytest.approx((f["V"] / (f["n"] * PROPELLER.diameter_m)).to_numpy())


def test_thrust_beyond_the_table_is_its_continuation_s_error_over_mass(forces: FlightForces) -> None:
    """A table that ends at J = 0.5 has an error beyond that, which is divided by the mass."""
    rows = tuple(
        replace(row, J=tuple(J for J in row.J if J <= 0.5), cT=row.cT[: sum(J <= 0.5 for J in row.J)],
                cP=row.cP[: sum(J <= 0.5 for J in row.J)])
        for row in PROPELLER.rows
    )  # fmt: skip
    short = type(PROPELLER)("short", PROPELLER.diameter_m, rows)
    f = FlightForces(forces.trajectory, AIRCRAFT, short).nominal
    n, rho = f["n"].to_numpy(), f["rho"].to_numpy()
    error_N = short.continuation_error(f["J"].to_numpy(), 60 * n) * rho * n**2 * short.diameter_m**4
    assert (error_N > 0).any()
    wanted = error_N * np.cos(f["alpha"].to_numpy()) / AIRCRAFT.mass_kg
    assert f["thrust_beyond_over_m_mps2"].to_numpy() == pytest.approx(wanted)


def test_dynamic_pressure_and_the_climb_are_by_their_definitions(forces: FlightForces) -> None:
    f, S = forces.nominal, AIRCRAFT.geometry.wing_area_m2
    assert f["qS_over_m_mps2"].to_numpy() == pytest.approx(
        (f["rho"] * f["V"] ** 2 / 2 * S / AIRCRAFT.mass_kg).to_numpy()
    )
    still = np.abs(forces.trajectory.states["gust_w"].to_numpy()) < 1e-9
    assert np.sin(f["gamma"].to_numpy()[still]) == pytest.approx((f["climb"] / f["V"]).to_numpy()[still], abs=1e-9)
