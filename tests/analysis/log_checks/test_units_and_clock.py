"""Units that a wrong log is said to be in, and intervals of its clock."""

import math

import pytest

from analysis.log_checks.clock import _wrong_interval
from analysis.log_checks.units import LIMITS
from flight.units import to_si

NAMES = {"hPa (mbar)": "hPa", "milliseconds": "ms", "degrees": "deg", "gauss": "100 uT", "mG": "100 nT"}
OF_FIELD = {"Pa": "Pa", "s": "s", "rad": "rad", "V": "V", "A": "A", "T": "T"}


def _one(unit: str) -> str:
    known = NAMES.get(unit, unit)
    return known if known[0].isdigit() else f"1 {known}"


def test_a_unit_s_factor_is_that_of_the_unit() -> None:
    """Throttle is a share; as a pulse its range is 1000 to 2000 microseconds."""
    checked = 0
    for limits in LIMITS:
        si = OF_FIELD.get(limits.field.rpartition("_")[2], "")
        for unit, factor in limits.units.items():
            expected = to_si(_one(unit), si, unit) if si else {"per cent": 0.01}.get(unit, 1 / 2000)
            assert factor == pytest.approx(expected, rel=1e-5), unit
            checked += 1
    assert checked >= 15


@pytest.mark.parametrize("interval_s", [0.005, 0.04, 1.0])
@pytest.mark.parametrize(("unit", "per_second"), [("microseconds", 1e6), ("milliseconds", 1e3), ("seconds", 1.0)])
def test_a_clock_s_unit_is_told_for_any_rate_of_a_daemon(interval_s: float, unit: str, per_second: float) -> None:
    """The number that should be nanoseconds: 200, 25 and 1 messages a second."""
    said = _wrong_interval(interval_s * per_second / 1e9)
    assert said.startswith(f"log_time is in {unit} ({interval_s * per_second:.0f} between messages)")


@pytest.mark.parametrize(
    ("rate_Hz", "said"),
    [(math.inf, "most messages have the log_time of the one before"), (400.0, "400 messages a second are too many"),
     (0.5, "2 s between messages")],
)  # fmt: skip
def test_another_interval_is_told_as_it_is(rate_Hz: float, said: str) -> None:
    assert _wrong_interval(1 / rate_Hz).startswith(said)
