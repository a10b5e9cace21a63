"""Efficiency from battery to thrust as the energy of a flight shows it, whatever power trains usually have.

What the motor takes raises, accelerates and pushes the aircraft: how energy and drag change with the measured power
gives the efficiency. The curve's own estimate has a prior of it, which a wrong current would fight. Here the measured
power also has a scale without a prior, so the efficiency follows from the data alone.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.methods.whole_flight.airspeed_gps import AirspeedErrors
from flightpower.analysis.methods.whole_flight.energy_balance import (
    EnergyBalance,
    FlightConditions,
    Samples,
    Useful,
    level_efficiency,
)
from flightpower.analysis.methods.whole_flight.fit import estimate_of, most_probable_fit
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable
from flightpower.analysis.methods.whole_flight.parameters import POWER_SCALE, Prior, pack
from flightpower.analysis.methods.whole_flight.settings import WINDOWS
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.arrays import Array


class ScaledPowerBalance(EnergyBalance):
    """The balance of one flight whose useful power has any scale: in whatever unit the power is measured."""

    def _names(self) -> tuple[str, ...]:
        return (*super()._names(), POWER_SCALE)

    def _useful(self, p: NamedValues, s: Samples, c: FlightConditions) -> Useful:
        useful = super()._useful(p, s, c)
        return useful._replace(power_W=np.exp(p.ln_power_scale) * useful.power_W)


def shown_efficiency(
    flight: FlightTable, balance: EnergyBalance, prior: Prior, airspeed: AirspeedErrors, V: Array
) -> Uncertain:
    """Natural logarithm of drag times airspeed over the measured power of the motor in level flight at V (n,).

    balance, prior: with a propeller's efficiency. Half as many windows as for a curve are enough. NaN at speeds that
    the motor cannot fly.
    """
    most_windows = min(balance.most_windows, WINDOWS.most // 2)
    free = ScaledPowerBalance(balance.samples, balance.conditions, most_windows)
    # The scale has no prior, so the result does not depend on its mean, which only starts the search: power needed over
    # useful power, by the priors.
    usual = pack(free.names, {name: mean for name, (mean, _) in prior.items()} | {POWER_SCALE: 0.0})
    thrust_power_W, surplus_W = free.thrust_power_W(usual), free.residual(usual)[: len(free.V_mps)]
    needed = max(1 - float(np.sum(surplus_W) / np.sum(thrust_power_W)), 0.01)
    fit = most_probable_fit(free, {**prior, POWER_SCALE: (float(np.log(needed)), np.inf)})
    return estimate_of(flight, free, fit, airspeed).quantity(partial(_of_measured_power, V, free.names))


def _of_measured_power(V: Array, names: Sequence[str], p: NamedValues, c: FlightConditions) -> Array:
    """Level flight takes the power at which the useful power without its scale is that part of drag."""
    unscaled = {name: p[name] for name in names}
    for name in ("ln_CD0", "ln_K"):
        unscaled[name] -= p.ln_power_scale
    unscaled["K4"] *= np.exp(-p.ln_power_scale)
    with np.errstate(invalid="ignore", divide="ignore"):
        efficiency = level_efficiency(V, NamedValues("parameter", unscaled), c)
        return np.asarray(p.ln_power_scale + np.log(efficiency))
