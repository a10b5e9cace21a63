"""How much of the flight the propeller table covers."""

from collections.abc import Set

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers.kinds import DECELERATION
from flight.errors import InputError
from flight.propeller import Propeller

Array = NDArray[np.float64]

NEARBY, LEAST_COVERED = 0.04, 0.5  # relative difference of speeds; share of the samples near a speed
LARGEST_UNMENTIONED_SHARE, LARGEST_SHARE_OUTSIDE = 0.02, 0.7  # of the runs, outside the propeller table


def thrust_known(flown: pd.DataFrame, V: Array) -> NDArray[np.bool_]:
    """Speeds V (k,) near which the propeller table covers at least LEAST_COVERED of the samples flown.

    flown : rows of the runs, columns V_mps and propeller_covered. A speed without samples nearby counts as known; it is
    an extrapolation for another reason.
    """
    speed, covered = flown["V_mps"].to_numpy(), flown["propeller_covered"].to_numpy(dtype=float)
    near = np.abs(speed / V[:, None] - 1) < NEARBY
    return np.asarray((near @ covered >= LEAST_COVERED * near.sum(axis=1)) | ~near.any(axis=1))


def thrust_coverage(
    flown: pd.DataFrame, propeller: Propeller, kinds: Set[str] = frozenset(), runs_file: str = ""
) -> list[str]:
    """A warning where some of the runs lie outside the propeller table.

    flown : rows of the runs, columns J, n_revps and propeller_covered.     kinds : of the runs
    runs_file : the file that selected the runs, for messages; empty where they were found in the data
    Raises InputError where most of them do.
    """
    outside = 1 - float(flown["propeller_covered"].mean())
    if outside <= LARGEST_UNMENTIONED_SHARE:
        return []
    largest_J = max(row.J[-1] for row in propeller.rows)
    if (flown["J"][~flown["propeller_covered"]] > largest_J).mean() > 0.5:
        low, high = np.nanpercentile(flown["J"], (2.5, 97.5))
        range_text = f"ends at J = {largest_J:.2f} (flown: {low:.2f} to {high:.2f})"
    else:
        low, high = np.nanpercentile(60 * flown["n_revps"], (2.5, 97.5))
        rpm = propeller.rows[0].rpm, propeller.rows[-1].rpm
        range_text = f"goes from {rpm[0]:.0f} to {rpm[1]:.0f} rpm (flown: {low:.0f} to {high:.0f})"
    text = f"propeller {propeller.name}: {100 * outside:.0f} % of the runs lie outside its table, which {range_text}"
    if outside > LARGEST_SHARE_OUTSIDE:
        if kinds == {DECELERATION} and runs_file:
            raise InputError(f"{runs_file}: keeps decelerations only, and {text}; keep an acceleration as well")
        if kinds == {DECELERATION}:
            raise InputError(f"{text}; all are decelerations: fly accelerations as well")
        raise InputError(f"{text}; is it the propeller that was flown?")
    rest = (
        "thrust is extrapolated linearly there, with an error that grows with the distance, and the curve is dashed"
        " where it depends mostly on that"
    )
    return [f"{text[0].upper()}{text[1:]}; {rest}."]
