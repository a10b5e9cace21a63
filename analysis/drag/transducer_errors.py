"""Errors of the pressure transducers that no residual of the flight shows, as consider terms."""

from collections.abc import Callable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.transducer_errors import CHANNELS, with_hysteresis, with_zero_step
from analysis.drag.assumed_values import AssumptionUncertainty
from flight.aircraft import Aircraft

ZERO_STEPS = {channel: f"zero step {channel}" for channel in CHANNELS}  # names of these errors
# Of the variance of a zero's change, the part that comes about in flight: as much as in the airstream at take-off.
SHARE_IN_FLIGHT = 0.5


def with_transducer_uncertainty(
    added: AssumptionUncertainty | None,
    values_from: Callable[[pd.DataFrame], NDArray[np.float64]],
    air: pd.DataFrame,
    aircraft: Aircraft,
) -> AssumptionUncertainty | None:
    """The uncertainty with that by one standard deviation of hysteresis and of a step of the zero in mid-flight,
    [uncertainty] hysteresis and transducer_zero, of each transducer. A change of the zero at take-off is among the
    sensor errors that are estimated.

    values_from: polar and thrust (5,) of the flight from air data, trajectory included.
    """
    uncertainty = aircraft.uncertainty
    fraction, step_Pa = uncertainty.hysteresis_fraction, np.sqrt(SHARE_IN_FLIGHT) * uncertainty.transducer_zero_Pa
    perturbed: dict[str, pd.DataFrame] = {}
    if fraction:
        perturbed |= {f"hysteresis {channel}": with_hysteresis(air, channel, fraction) for channel in CHANNELS}
    if step_Pa:
        perturbed |= {name: with_zero_step(air, channel, step_Pa) for channel, name in ZERO_STEPS.items()}
    if not perturbed:
        return added
    nominal = values_from(air)
    changes = {name: values_from(other) - nominal for name, other in perturbed.items()}
    covariance = np.sum([np.outer(change, change) for change in changes.values()], axis=0)
    if added is None:
        return AssumptionUncertainty(covariance, [], changes)
    return added._replace(covariance=added.covariance + covariance, changes={**added.changes, **changes})
