"""The laws of attitude: each rate about a body axis follows from the aircraft's rotation."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flightpower.analysis.sources.laws import Grid, _attitude_laws
from flightpower.analysis.sources.quantities import Quantity
from flightpower.analysis.sources.recording import Channel

T_S = np.arange(0.0, 120.0, 0.05)
ATTITUDE = {
    Quantity.ROLL: 0.9 * np.sin(2 * np.pi * T_S / 37),
    Quantity.PITCH: 0.4 * np.sin(2 * np.pi * T_S / 23 + 1),
    Quantity.HEADING: 0.15 * T_S,
}
RATES = (Quantity.ROLL_RATE, Quantity.PITCH_RATE, Quantity.YAW_RATE)


def turning_rates() -> np.ndarray:
    """Rates about the body axes, (3, n) [rad/s], that turn each attitude into the next."""
    roll, pitch, heading = ATTITUDE.values()
    attitude = Rotation.from_euler("ZYX", np.stack([heading, pitch, roll], axis=1))
    turned = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / (T_S[1] - T_S[0])
    return np.asarray(np.vstack([turned, turned[-1:]]).T)


def laws_of(*rates: Quantity) -> dict[Quantity, tuple[np.ndarray, np.ndarray]]:
    """Both sides of the attitude laws for a table with attitude and these rates, without its ends."""
    all_rates = dict(zip(RATES, turning_rates(), strict=True))
    columns = ATTITUDE | {rate: all_rates[rate] for rate in rates}
    grid = Grid({quantity: Channel(T_S, values) for quantity, values in columns.items()})
    inside = slice(20, -20)
    return {law.quantities[0]: (law.first[inside], law.second[inside]) for law in _attitude_laws(grid)}


@pytest.mark.parametrize("rates", [*((rate,) for rate in RATES), RATES], ids=" ".join)
def test_each_rate_is_that_of_the_rotation(rates: tuple[Quantity, ...]) -> None:
    """They agree within three hundredths of the spread: smoothing over a second and differences over 0.2 s leave that
    much."""
    laws = laws_of(*rates)
    assert set(laws) == set(rates)
    for rate, (first, second) in laws.items():
        assert np.std(first) > 0.03, "it turns about each axis"
        assert np.abs(first - second).max() < 0.03 * np.std(first), rate
