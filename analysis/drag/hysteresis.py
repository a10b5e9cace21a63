"""Hysteresis of the pressure transducers as a consider term: no residual of the flight shows it."""

from collections.abc import Callable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.hysteresis import CHANNELS, with_hysteresis
from analysis.drag.assumed_values import AssumptionUncertainty
from flight.aircraft import Aircraft


def with_hysteresis_uncertainty(
    added: AssumptionUncertainty | None,
    values_from: Callable[[pd.DataFrame], NDArray[np.float64]],
    air: pd.DataFrame,
    aircraft: Aircraft,
) -> AssumptionUncertainty | None:
    """The uncertainty with that by hysteresis of one standard deviation, [uncertainty] hysteresis, of each transducer.

    values_from: polar and thrust (5,) of the flight from air data, trajectory included.
    """
    fraction = aircraft.uncertainty.hysteresis_fraction
    if fraction == 0:
        return added
    nominal = values_from(air)
    changes = {
        f"hysteresis {channel}": values_from(with_hysteresis(air, channel, fraction)) - nominal for channel in CHANNELS
    }
    covariance = np.sum([np.outer(change, change) for change in changes.values()], axis=0)
    if added is None:
        return AssumptionUncertainty(covariance, [], changes)
    return added._replace(covariance=added.covariance + covariance, changes={**added.changes, **changes})
