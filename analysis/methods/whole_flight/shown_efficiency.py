"""Efficiency from battery to thrust as the energy of a flight shows it, whatever the usual efficiency is.

The motor's power raises and accelerates the aircraft and overcomes its drag, so the change of energy and drag with the
measured power gives the efficiency. The curve's own estimate has a prior of the efficiency, which would conflict with a
wrong current. Here the measured power also has a scale without a prior, so the efficiency follows from the data alone.
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
    """The balance of one flight with a free scale of useful power, as if power were measured in an unknown unit."""

    def _names(self) -> tuple[str, ...]:
        return (*super()._names(), POWER_SCALE)

    def _useful(self, p: NamedValues, s: Samples, c: FlightConditions) -> Useful:
        useful = super()._useful(p, s, c)
        return useful._replace(power_W=np.exp(p.ln_power_scale) * useful.power_W)


def shown_efficiency(
    flight: FlightTable, balance: EnergyBalance, prior: Prior, airspeed: AirspeedErrors, V: Array
) -> Uncertain:
    """Natural logarithm (n,) of drag times airspeed over the motor's measured power, in level flight at V (n,).

    balance, prior: those with a propeller's efficiency. Half as many windows as for a curve are enough. The result is
    NaN at speeds for which the motor's power does not suffice.
    """
    most_windows = min(balance.most_windows, WINDOWS.most // 2)
    free = ScaledPowerBalance(balance.samples, balance.conditions, most_windows)
    # The scale has no prior, so the result does not depend on its mean, which only starts the search. The mean is power
    # needed over useful power, by the priors.
    usual = pack(free.names, {name: mean for name, (mean, _) in prior.items()} | {POWER_SCALE: 0.0})
    thrust_power_W, surplus_W = free.thrust_power_W(usual), free.residual(usual)[: len(free.V_mps)]
    needed = max(1 - float(np.sum(surplus_W) / np.sum(thrust_power_W)), 0.01)
    fit = most_probable_fit(free, {**prior, POWER_SCALE: (float(np.log(needed)), np.inf)})
    return estimate_of(flight, free, fit, airspeed).quantity(partial(_of_measured_power, V, free.names))


def _of_measured_power(V: Array, names: Sequence[str], p: NamedValues, c: FlightConditions) -> Array:
    """The logarithm (n,) of the efficiency of level flight, with respect to measured power.

    Drag is divided by the scale, so that useful power without the scale balances it.
    """
    unscaled = {name: p[name] for name in names}
    for name in ("ln_CD0", "ln_K"):
        unscaled[name] -= p.ln_power_scale
    unscaled["K4"] *= np.exp(-p.ln_power_scale)
    with np.errstate(invalid="ignore", divide="ignore"):
        efficiency = level_efficiency(V, NamedValues("parameter", unscaled), c)
        return np.asarray(p.ln_power_scale + np.log(efficiency))
