"""The cross-check uses air data from which errors that only the whole flight shows have been removed."""

import pytest
from constructed import accelerations_and_decelerations, measured

from flightpower.analysis.methods.ladder import without_model_errors


def test_vibration_and_bending_that_the_flight_showed_are_taken_out() -> None:
    f, _ = accelerations_and_decelerations()
    errors = {"ax_vibration": 0.1, "az_vibration": -0.2, "alpha_per_g": 0.02}
    trajectory = measured(f, **errors)
    exact = f[["alpha"]].assign(ax_mps2=f["ax"], az_mps2=f["az"], alpha_rad=f["alpha"])
    exact["n_revps"] = trajectory.block_means["n_revps"]
    shaken, load = (exact["n_revps"] / 100) ** 2, -exact["az_mps2"] / 9.80665
    wrong = exact.assign(
        ax_mps2=exact["ax_mps2"] + 0.1 * shaken,
        az_mps2=exact["az_mps2"] - 0.2 * shaken,
        alpha_rad=exact["alpha_rad"] + 0.02 * (load - 1),
    )
    table = without_model_errors(wrong, trajectory)
    for name, within in (("ax_mps2", 1e-9), ("az_mps2", 1e-9), ("alpha_rad", 1e-3)):
        assert table[name].to_numpy() == pytest.approx(exact[name].to_numpy(), abs=within), name
