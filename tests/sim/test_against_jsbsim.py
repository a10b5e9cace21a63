"""The simulator against one that was not written here: JSBSim, with an aircraft made from our aircraft file.

JSBSim trims nothing and controls nothing: it is put into our state and given the surface angles and motor speed of our
flight, and has to fly the same. Its earth turns and is round, and gravity there is that of 45 deg latitude; hence the
tolerances: 1 % of speed and power, 0.2 deg of angle of attack.
"""

from itertools import pairwise

import numpy as np
import pytest

from flightpower.flight.atmosphere import SEA_LEVEL_PRESSURE_PA, SEA_LEVEL_TEMPERATURE_K
from flightpower.sim.air import Air
from flightpower.sim.fly import fly
from flightpower.sim.plan import parse_plan
from flightpower.sim.plant import AircraftState, plant_of
from flightpower.sim.trim import Trimmer

jsbsim = pytest.importorskip("jsbsim", reason="JSBSim is not installed")
from jsbsim_model import FT, LBF, write  # noqa: E402

STANDARD = Air(ground_pressure_Pa=SEA_LEVEL_PRESSURE_PA, ground_temperature_K=SEA_LEVEL_TEMPERATURE_K)
STEPS = 16  # steps of JSBSim in one of ours: it acts on the state of the step before, so steps have to be short
HEAD = f"""
title = "for comparison"
height = "100 m"
speed_over_stall = 1.6
[air]
ground_pressure = "{SEA_LEVEL_PRESSURE_PA} Pa"
ground_temperature = "{SEA_LEVEL_TEMPERATURE_K} K"
"""
RUN = '[[segment]]\nkind = "run"\nthrottle = 1.0\nspeed_of_max = 0.93\n'
DOUBLET = '[[segment]]\nkind = "3-2-1-1"\nunits = [1.0, 1.0]\namplitude = "4 deg"\nunit = "0.5 s"\nrest = "4 s"\n'
STEPS_3211 = '[[segment]]\nkind = "3-2-1-1"\namplitude = "4 deg"\nunit = "0.3 s"\nrest = "3 s"\n'
MANEUVER_S = 5.0


@pytest.fixture(scope="module")
def standard_plant(nexstar):
    return plant_of(nexstar, STANDARD)


@pytest.fixture
def other(standard_plant, tmp_path):
    """JSBSim with our aircraft loaded, to be started in a state of ours."""
    fdm = jsbsim.FGFDMExec(str(tmp_path))
    fdm.set_debug_level(0)
    assert fdm.load_model(write(standard_plant, tmp_path))
    fdm.set_dt(0.02 / STEPS)

    def start(x: AircraftState):
        steer(fdm, x.elevator, x.aileron, x.rudder, x.motor)
        for name, value in {
            "lat-geod-deg": 45.0,
            "h-sl-ft": -x.down / FT,
            "u-fps": x.u / FT,
            "v-fps": x.v / FT,
            "w-fps": x.w / FT,
            "phi-rad": x.phi,
            "theta-rad": x.theta,
            "psi-true-rad": x.psi,
            "p-rad_sec": x.p,
            "q-rad_sec": x.q,
            "r-rad_sec": x.r,
        }.items():
            fdm[f"ic/{name}"] = value
        assert fdm.run_ic()
        return fdm

    return start


def steer(fdm, elevator, aileron, rudder, motor):
    for name, value in zip(("elevator", "aileron", "rudder", "n"), (elevator, aileron, rudder, motor), strict=True):
        fdm[f"test/{name}"] = float(value)


def state(fdm) -> tuple[float, float, float]:
    """Airspeed [m/s], angle of attack [rad], power of the thrust [W]."""
    V = fdm["velocities/vt-fps"] * FT
    return V, fdm["aero/alpha-rad"], fdm["test/thrust-lbf"] * LBF * V


@pytest.mark.parametrize("over_stall", [1.3, 1.6, 2.2])
def test_our_trim_is_trimmed_there(standard_plant, other, over_stall):
    trimmer = Trimmer(standard_plant, 100.0)
    trim = trimmer.solve(V=over_stall * trimmer.V_stall, climb=0.0)
    fdm = other(trim.state())
    now, _ = standard_plant.instant(trim.state(), trim.commands)
    for _ in range(10 * 50 * STEPS):
        fdm.run()
        V, alpha, power = state(fdm)
        assert trim.unknowns.V == pytest.approx(V, rel=0.01)
        assert trim.unknowns.alpha == pytest.approx(alpha, abs=np.deg2rad(0.2))
        assert now.train.thrust_N * trim.unknowns.V == pytest.approx(power, rel=0.01)
    assert fdm["position/h-sl-ft"] * FT == pytest.approx(100.0, abs=1.0)


@pytest.mark.parametrize("maneuver", [RUN, DOUBLET, STEPS_3211], ids=["acceleration", "elevator-doublet", "3-2-1-1"])
def test_a_flight_of_ours_is_flown_the_same_there(nexstar, other, maneuver):
    truth = fly(nexstar, parse_plan(HEAD + maneuver, "comparison")).truth
    # The recovery after the elevator input is left out: the motor jumps faster there than JSBSim shows its thrust.
    truth = truth[truth["segment"] == 0].iloc[: None if maneuver == RUN else round(MANEUVER_S / 0.02)]
    columns = ("elevator_rad", "aileron_rad", "rudder_rad", "motor_speed_revps")
    controls = truth[list(columns)].to_numpy()
    first = truth.iloc[0]
    x = dict.fromkeys(AircraftState._fields, 0.0) | {
        name: first[column]
        for name, column in {
            "u": "u_mps",
            "v": "v_mps",
            "w": "w_mps",
            "phi": "roll_rad",
            "theta": "pitch_rad",
            "p": "p_radps",
            "q": "q_radps",
            "r": "r_radps",
        }.items()
    }
    elevator, aileron, rudder, motor = controls[0]
    fdm = other(
        AircraftState(**x)._replace(down=-100.0, elevator=elevator, aileron=aileron, rudder=rudder, motor=motor)
    )
    results = [state(fdm)]
    for before, after in pairwise(controls):
        for i in range(STEPS):
            # Controls of halfway through the step that follows, which is as good as a linear course within it.
            steer(fdm, *(before + (after - before) * (i + 0.5) / STEPS))
            fdm.run()
        steer(fdm, *after)
        results.append(state(fdm))
    V, alpha, _ = np.array(results).T
    assert np.ptp(truth["V_mps"] if maneuver == RUN else np.rad2deg(truth["alpha_rad"])) > 4
    assert np.max(np.abs(V / truth["V_mps"] - 1)) < 0.01
    assert np.max(np.abs(np.rad2deg(alpha - truth["alpha_rad"]))) < 0.2
    # JSBSim gives the thrust of the step before, so power is compared with the speed and motor of each instant.
    power = truth["thrust_N"].to_numpy() * truth["V_mps"].to_numpy()
    first_order_lag = np.array(results)[1:, 2]
    assert np.max(np.abs(first_order_lag / power[1:] - 1)) < 0.01
