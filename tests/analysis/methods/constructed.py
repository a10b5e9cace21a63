"""Flights whose forces are in exact balance, with a known drag polar and a known propeller: no noise, no errors."""

import numpy as np
import pandas as pd

from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods.causes import CAUSES, error_prior_sigma
from flightpower.analysis.methods.method import MethodInputs
from flightpower.analysis.methods.regression import Tables
from flightpower.analysis.trajectory.block_means import BlockMeans
from flightpower.analysis.trajectory.equations import PREDICTED_FLOW, SENSOR_ERRORS, STATES
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.smoother import StatesGivenErrors
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.atmosphere import GAS_CONSTANT_AIR
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.units import GRAVITY_MPS2

AIRCRAFT = load_aircraft("nexstar")
PROPELLER = load_propeller(AIRCRAFT.propulsion.propeller)
S, W, m = AIRCRAFT.geometry.wing_area_m2, AIRCRAFT.mass.weight_N, AIRCRAFT.mass_kg
STEP_S, BLOCK = 0.2, 5
RHO, TEMPERATURE_K = 1.15, 280.0
J_REFERENCE = 0.5


def polar(CL_minD: float = 0.15, CD0: float = 0.045, K: float = 0.065) -> np.ndarray:
    return np.array([CD0 + K * CL_minD**2, -2 * K * CL_minD, K])


def angle(CL):
    return (CL - 0.3) / 4.6


def flown(V, A, rho, gamma=0.0, weight_N=W) -> pd.DataFrame:
    """Return the methods' table of a flight at speeds V (n,) on a straight path, with forces in exact balance.

    The wing carries the part of the weight that thrust does not: L + T sin(alpha) = W cos(gamma); D + m Vdot + W
    sin(gamma) = T cos(alpha).
    """
    t = np.arange(len(V)) * STEP_S
    V = np.asarray(V, dtype=float)
    Vdot = np.gradient(V, t) if np.ptp(V) else np.zeros_like(V)
    mass = weight_N / GRAVITY_MPS2
    qS = rho * V**2 / 2 * S
    lift = np.full_like(V, weight_N * np.cos(gamma))
    for _ in range(50):
        CL = lift / qS
        drag = qS * (A[0] + A[1] * CL + A[2] * CL**2)
        thrust = (drag + mass * Vdot + weight_N * np.sin(gamma)) / np.cos(angle(CL))
        lift = weight_N * np.cos(gamma) - thrust * np.sin(angle(CL))
    alpha = angle(CL)
    forward, down = thrust - drag * np.cos(alpha) + lift * np.sin(alpha), -drag * np.sin(alpha) - lift * np.cos(alpha)
    height = 100 + np.concatenate([[0], np.cumsum((V[1:] + V[:-1]) / 2 * STEP_S * np.sin(gamma))])
    columns = {
        "V": V, "V_measured": V, "alpha": alpha, "alpha_measured": alpha, "gamma": gamma,
        "theta_measured": gamma + alpha, "climb": V * np.sin(gamma), "bank": 0.0, "Vdot": Vdot, "rho": rho,
        "ax": forward / mass, "az": down / mass,
        "qS_over_m_mps2": qS / mass, "qS_over_m_measured_mps2": qS / mass,
        "thrust_x_over_m_mps2": thrust / mass, "thrust_x_over_m_measured_mps2": thrust / mass,
        "height_measured": height, "static_Pa": rho * GAS_CONSTANT_AIR * TEMPERATURE_K, "temperature_K": TEMPERATURE_K,
        "covered": 1.0, "J": 0.5, "gust_mps": 0.0, "gust_s": 4.0,
        "gust_along_mps": 0.0, "gust_along_s": 9.0,
    }  # fmt: skip
    return pd.DataFrame(columns, index=t)


def accelerations_and_decelerations(gamma: float = 0.0) -> tuple[pd.DataFrame, list[Maneuver]]:
    """Return the methods' table of a flight without gaps and its runs: two up and two down, at different rates."""
    V = np.concatenate(
        [np.linspace(11.5, 23, 60), np.linspace(23, 11.5, 90), np.linspace(11.5, 23, 80), np.linspace(23, 11.5, 70)]
    )
    kinds = np.repeat(["acceleration", "deceleration", "acceleration", "deceleration"], [60, 90, 80, 70])
    ends = np.flatnonzero(np.r_[kinds[1:] != kinds[:-1], True])
    starts = np.r_[0, ends[:-1] + 1]
    runs = [
        Maneuver(str(kinds[i]), slice(i * BLOCK, (j + 1) * BLOCK), i * STEP_S, j * STEP_S, 11.5, 23.0, 0.0)
        for i, j in zip(starts, ends, strict=True)
    ]
    return flown(V, polar(), RHO, gamma), runs


def speed_of_rotation(thrust_N: np.ndarray, V: np.ndarray, scale: float, slope: float) -> np.ndarray:
    """Find by bisection the n [rev/s] at which thrust_N is table thrust times 1 + scale + slope (J - J_REFERENCE)."""
    low, high = np.full_like(V, 20.0), np.full_like(V, 250.0)
    for _ in range(60):
        n = (low + high) / 2
        table_N, _ = PROPELLER.thrust_and_power(V, n, RHO)
        J = V / (n * PROPELLER.diameter_m)
        much = table_N * (1 + scale + slope * (J - J_REFERENCE)) > thrust_N
        low, high = np.where(much, low, n), np.where(much, n, high)
    return (low + high) / 2


def measured(f: pd.DataFrame, scale: float = 0.0, slope: float = 0.0, **sensor_errors: float) -> Trajectory:
    """Return the exact trajectory of a flight `f`, due north in still air, with its measurements.

    scale, slope: errors of the propeller table's thrust. sensor_errors: errors that the trajectory contains. Of these,
    only ax_bias is added to the measurements here; a test adds the others itself.
    """
    V, gamma, n_blocks = f["V"].to_numpy(), f["gamma"].to_numpy(), len(f)
    n = speed_of_rotation(f["thrust_x_over_m_mps2"].to_numpy() * m, V, scale, slope)
    columns = {
        "ax_mps2": f["ax"] + sensor_errors.get("ax_bias", 0.0), "ay_mps2": 0.0, "az_mps2": f["az"], "V_mps": V,
        "alpha_rad": f["alpha"],
        "height_m": f["height_measured"], "rho": RHO, "n_revps": n, "static_Pa": f["static_Pa"],
        "temperature_K": f["temperature_K"], "propeller_covered": 1.0, "flying": 1.0,
        "dalpha_dlndp_alpha_rad": f["alpha"], "alpha_by_upwash_rad": 0.0,
    }  # fmt: skip
    table = pd.DataFrame(columns).loc[f.index.repeat(BLOCK)]
    table.index = (np.arange(n_blocks * BLOCK) - BLOCK // 2) * STEP_S / BLOCK
    states = pd.DataFrame(0.0, index=f.index, columns=list(STATES))
    states["theta"] = f["alpha"] + gamma
    states["v_north"], states["v_down"], states["height"] = V * np.cos(gamma), -V * np.sin(gamma), f["height_measured"]
    errors = np.array([sensor_errors.get(name, 0.0) for name in SENSOR_ERRORS])
    m_errors = len(SENSOR_ERRORS)
    flow = {"V_predicted": V, "alpha_predicted": f["alpha"].to_numpy()}
    return Trajectory(
        states=states,
        sensor_errors=errors,
        covariance=1e-16 * np.eye(m_errors),
        prior_sigma=np.ones(m_errors),
        state_sensitivity=np.zeros((n_blocks, len(STATES), m_errors)),
        states_given_errors=StatesGivenErrors(np.full((1, n_blocks * len(STATES)), 1e16)),  # practically exact
        draws=np.zeros((1, n_blocks, len(STATES))),
        predicted_flow=np.column_stack([flow.get(name, np.zeros(n_blocks)) for name in PREDICTED_FLOW]),
        gust_mps=0.0,
        residuals={},
        converged=True,
        block_means=BlockMeans(table),
    )


def tables_of(table: pd.DataFrame) -> Tables:
    """Return a data frame, with its times as index, as a table for the methods."""
    return Tables(table.index.to_numpy(), {name: column.to_numpy(dtype=float) for name, column in table.items()})


def same_everywhere(table: pd.DataFrame, runs: list[Maneuver]) -> MethodInputs:
    """Return the inputs of all methods for a flight that no error changes, with a single trajectory error."""
    errors = tuple(error_prior_sigma(AIRCRAFT.uncertainty))
    count = 1 + 1 + len(errors) + len(CAUSES)
    columns = {name: np.tile(column.to_numpy(float), (count, 1)) for name, column in table.items()}
    return MethodInputs(AIRCRAFT, runs, Tables(table.index.to_numpy(), columns), errors)
