"""Hysteresis of the pressure transducers as a consider term: no residual of the flight shows it."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from analysis.airdata.hysteresis import CHANNELS, with_hysteresis
from analysis.drag.assumed_values import AssumptionUncertainty
from analysis.drag.dynamic import DynamicEstimate
from flight.aircraft import Aircraft


def with_hysteresis_uncertainty(
    added: AssumptionUncertainty | None,
    estimate_from: Callable[[pd.DataFrame], DynamicEstimate],
    air: pd.DataFrame,
    aircraft: Aircraft,
) -> AssumptionUncertainty | None:
    """The uncertainty with that by hysteresis of one standard deviation, [uncertainty] hysteresis, of each transducer.

    estimate_from: the estimate of the flight from air data, trajectory included; it is repeated for each transducer.
    """
    fraction = aircraft.uncertainty.hysteresis_fraction
    if fraction == 0:
        return added
    nominal = estimate_from(air).values
    changes = [estimate_from(with_hysteresis(air, channel, fraction)).values - nominal for channel in CHANNELS]
    covariance = np.sum([np.outer(change, change) for change in changes], axis=0)
    if added is None:
        return AssumptionUncertainty(covariance, [])
    return added._replace(covariance=added.covariance + covariance)
