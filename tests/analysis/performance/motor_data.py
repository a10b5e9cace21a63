"""Power train data without a flight: the power that the simulator's motor draws at given air and motor speeds."""

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from flightpower.analysis.performance.full_throttle import FullThrottle
from flightpower.analysis.performance.level_flight import PerformanceModel
from flightpower.analysis.performance.power_train import PowerTrainModel
from flightpower.analysis.performance.propagation import ParameterVector, exact
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.propeller import Propeller
from flightpower.sim.air import Air, ambient
from flightpower.sim.plant import plant_of
from flightpower.sim.propulsion import power_train, throttle_for

RHO, STEP_S = 1.19, 0.2
POLAR = {"A0": 0.0465, "A1": -0.0195, "A2": 0.065}
NO_CORRECTION = {"thrust_scale": 0.0, "thrust_slope": 0.0}
ALONG_PATH = {"alpha_0": 0.0, "alpha_CL": 0.0}  # thrust along the path carries no weight
LOSSLESS = PowerTrainModel(exact(shaft_scale=1.0, friction=0.0, copper=0.0, meter_scale=0.0), 0.0, True, "", ())
FLOWN_CL = (0.2, 1.1)


def model_of(
    parameters: ParameterVector,
    propeller: Propeller,
    train: PowerTrainModel = LOSSLESS,
    flown_CL: tuple[float, float] = FLOWN_CL,
) -> PerformanceModel:
    """Return a model; full throttle is known only if `parameters` contain it."""
    motor = FullThrottle(parameters if "unloaded_revps" in parameters.names else None, reason="not flown")
    return PerformanceModel(parameters, train, motor, propeller, flown_CL)


def height_of(air: Air, rho: float) -> float:
    """Return the height [m] at which the simulator's air has the density `rho` [kg/m^3]."""
    return float(brentq(lambda h: float(ambient(air, h).density) - rho, -1000, 4000))


def incidence_of(nexstar: Aircraft) -> ParameterVector:
    """Return the simulator's angle of attack as a line over lift coefficient, with the elevator in trim."""
    aero = plant_of(nexstar).aero
    slope = 1 / (aero.CLa - aero.CLde * aero.Cma / aero.Cmde)
    return exact(alpha_0=-slope * (aero.CL0 - aero.CLde * aero.Cm0 / aero.Cmde), alpha_CL=slope)


def steady_points(nexstar: Aircraft, propeller: Propeller, seconds: float = 20.0) -> pd.DataFrame:
    """Return five steady points in sequence; the speed and advance ratio of each give its motor speed."""
    V = np.repeat([12.0, 14.0, 16.5, 19.5, 22.5], round(seconds / STEP_S))
    n = V / (np.repeat([0.56, 0.62, 0.66, 0.66, 0.62], round(seconds / STEP_S)) * propeller.diameter_m)
    throttle = throttle_for(nexstar.propulsion, propeller, V=V, n=n, rho=RHO)
    return recorded(nexstar, propeller, V, n, throttle)


def full_throttle_run(nexstar: Aircraft, propeller: Propeller, seconds: float = 8.0) -> pd.DataFrame:
    """Return an acceleration at full throttle, with motor and propeller torque in balance at every speed."""
    return at_throttle(nexstar, propeller, np.linspace(12.0, 24.0, round(seconds / STEP_S)), 1.0)


def at_throttle(nexstar: Aircraft, propeller: Propeller, V, throttle: float) -> pd.DataFrame:
    """Return data at speeds V (n,) [m/s] in sequence, with motor and propeller torque in balance at this throttle."""
    low, high = np.full_like(V, 20.0), np.full_like(V, 200.0)
    for _ in range(60):
        n = (low + high) / 2
        train = power_train(nexstar.propulsion, propeller, V=V, n=n, throttle=throttle, rho=RHO)
        faster = train.motor_acceleration_revps2 > 0
        low, high = np.where(faster, n, low), np.where(faster, high, n)
    return recorded(nexstar, propeller, V, (low + high) / 2, np.full_like(V, throttle))


def recorded(nexstar: Aircraft, propeller: Propeller, V, n, throttle) -> pd.DataFrame:
    train = power_train(nexstar.propulsion, propeller, V=V, n=n, throttle=throttle, rho=RHO)
    columns = {
        "V": V,
        "n": n,
        "rho": np.full_like(V, RHO),
        "throttle": throttle,
        "covered": propeller.covers(V / (n * propeller.diameter_m), 60 * n),
        "battery_W": train.battery_voltage_V * train.battery_current_A,
    }
    return pd.DataFrame(columns, index=pd.Index(np.arange(len(V)) * STEP_S, name="t_s"))
