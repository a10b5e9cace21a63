"""Tests how options that are lists are typed, and that wrong ones are refused in one line."""

import pytest

from flightpower.analysis.options import Options, parse_stretches, stretches_text
from flightpower.flight.errors import InputError


@pytest.mark.parametrize(
    "text", ["120 to 180 s, 300 to 320.5 s", "300 s to 320.5 s,120-180", " 120 – 180 s , 300 to 320.5"]
)
def test_stretches_are_read_in_order_of_time(text: str) -> None:
    stretches = parse_stretches(text, "--leave-out")
    assert stretches == ((120.0, 180.0), (300.0, 320.5)) == Options(leave_out=text).left_out_s
    assert parse_stretches(stretches_text(stretches), "--leave-out") == stretches
    assert stretches_text(stretches) == "120.0 to 180.0 s, 300.0 to 320.5 s"


@pytest.mark.parametrize(
    "text", ["", "120", "180 to 120 s", "120 to 120 s", "a to b", "1 to 2 min", "1.2.3 to 4 s", "-5 to 9"]
)
def test_what_is_no_stretch_is_refused_when_the_options_are_made(text: str) -> None:
    with pytest.raises(InputError, match=r"^--leave-out: .*120 to 180 s") as refused:
        Options(leave_out=text)
    assert "\n" not in str(refused.value)
