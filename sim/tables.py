"""Makes the tables that `sim trim` and `sim modes` print."""

import numpy as np
from rich.markup import escape
from rich.table import Table

from flightpower.flight.errors import InputError
from flightpower.sim.modes import modes
from flightpower.sim.trim import Trimmer, power_required


def trim_table(
    trimmer: Trimmer, *, bank_rad: float, climb_mps: float, speed_mps: float | None, motor_revps: float | None
) -> Table:
    """Table of trimmed flight at one airspeed, at one motor speed, or (without either) over the level airspeeds.

    Raises InputError if a single condition was given and cannot be flown.
    """
    plant = trimmer.plant
    motor = {} if motor_revps is None else {"motor": motor_revps}
    conditions: list[dict[str, float]]
    if speed_mps is not None:
        conditions = [{"V": speed_mps, **(motor or {"climb": climb_mps})}]
    elif motor:
        conditions = [{**motor, "climb": climb_mps}]
    else:
        speeds = np.linspace(1.05 * trimmer.V_stall, 0.999 * trimmer.V_max, 10)
        conditions = [{"V": float(V), "climb": climb_mps} for V in speeds]
    table = Table(
        box=None,
        title=f"{escape(plant.aircraft.title)}, {trimmer.height_m:.0f} m, {np.rad2deg(bank_rad):.0f} deg of bank",
    )
    for heading in (
        "V\n[m/s]",
        "climb\n[m/s]",
        "alpha\n[deg]",
        "elevator\n[deg]",
        "pitch\n[deg]",
        "rpm",
        "throttle",
        "J",
        "P_req\n[W]",
    ):
        table.add_column(escape(heading), justify="right")
    for condition in conditions:
        try:
            trimmed = trimmer.solve(bank_rad=bank_rad, start=None, **condition)
        except InputError:
            if len(conditions) == 1:
                raise
            continue  # conditions that cannot be flown are omitted
        z = trimmed.unknowns
        power, _, _ = power_required(plant, np.array([z.V]), density=trimmer.density)
        J = z.V / (z.motor * plant.propeller.diameter_m)
        table.add_row(
            f"{z.V:.2f}",
            f"{z.climb:+.2f}",
            f"{np.rad2deg(z.alpha):.2f}",
            f"{np.rad2deg(z.elevator):.2f}",
            f"{np.rad2deg(z.theta):.2f}",
            f"{60 * z.motor:.0f}",
            f"{trimmed.throttle:.3f}",
            f"{J:.3f}",
            f"{power[0]:.1f}",
        )
    if not table.row_count:
        raise InputError(
            f"{plant.aircraft.name}: {climb_mps:+.2f} m/s of climb at {np.rad2deg(bank_rad):.0f} deg of bank cannot be"
            " flown at any speed"
        )
    return table


def modes_table(trimmer: Trimmer, V: float) -> Table:
    """The modes about level trim at airspeed V [m/s]."""
    rows = modes(trimmer.plant, trimmer.solve(V=V, climb=0.0))
    table = Table(box=None, title=f"{escape(trimmer.plant.aircraft.title)}, {V:.2f} m/s, {trimmer.height_m:.0f} m")
    for heading in ("mode", "eigenvalue\n[1/s]", "frequency\n[Hz]", "damping", "period\n[s]", "time constant\n[s]"):
        table.add_column(escape(heading), justify="left" if heading == "mode" else "right")
    for mode in rows:
        oscillates = bool(mode.eigenvalue.imag)
        table.add_row(
            mode.name,
            f"{mode.eigenvalue:.3f}" if oscillates else f"{mode.eigenvalue.real:.4f}",
            f"{mode.natural_frequency_radps / (2 * np.pi):.3f}" if oscillates else "",
            f"{mode.damping:.3f}" if oscillates else "",
            f"{mode.period_s:.2f}" if oscillates else "",
            f"{mode.time_constant_s:.2f}",
        )
    return table
