"""Inputs for manoeuvres: steps, and multisines."""

import numpy as np
import pytest

from analysis.estimation.input_design import _peak_factor, doublet, multisine, steps, three_two_one_one
from flight.errors import InputError


def test_a_3211_excites_the_band_about_its_mode_and_no_trim():
    """7 units with areas 3 - 2 + 1 - 1 = 1: little at zero frequency; half its peak power over more than 1 : 3."""
    u = three_two_one_one(2.1, 0.1, 0.02)
    spectrum = np.abs(np.fft.rfft(u, 8192)) ** 2
    f = np.fft.rfftfreq(8192, 0.02)
    wide = f[spectrum > spectrum.max() / 2]
    assert wide.max() / wide.min() > 2.5
    assert wide.min() < 1 / 2.1 < wide.max()
    assert np.abs(u).max() == 0.1 and u[0] == u[-1] == 0


@pytest.mark.parametrize(
    ("signal", "seconds"),
    [
        (three_two_one_one(2.1, 0.1, 0.02), (2.1, 1.4, 0.7, 0.7)),  # a third of the mode's period
        (doublet(1.2, 0.1, 0.02), (0.6, 0.6)),  # half of it
        (steps((2, 1), 0.5, 0.1, 0.02, start_s=0.4), (1.0, 0.5)),
    ],
)
def test_steps_last_as_told_and_alternate(signal, seconds):
    start = round((0.4 if len(seconds) == 2 and seconds[0] == 1.0 else 1.0) / 0.02)
    parts = [np.full(round(s / 0.02), 0.1 if i % 2 == 0 else -0.1) for i, s in enumerate(seconds)]
    assert signal == pytest.approx(np.concatenate([np.zeros(start), *parts, np.zeros(start)]))
    assert len(steps((1, 1), 0.04, 0.1, 0.04)) == 52, "a unit of one sample can be flown"


def test_a_sine_has_a_relative_peak_factor_of_one():
    t = np.arange(1000) / 1000
    assert _peak_factor(0.3 * np.sin(2 * np.pi * t)) == pytest.approx(1.0, rel=1e-3)
    assert _peak_factor(np.sign(np.sin(2 * np.pi * (t + 0.0005)))) == pytest.approx(1 / np.sqrt(2), rel=1e-3)


def test_a_doublet_has_no_mean():
    u = doublet(1.2, 3.0, 0.04)
    assert u.sum() == 0 and set(np.unique(u)) == {-3.0, 0.0, 3.0}


def test_multisines_are_orthogonal_within_their_limits_and_begin_at_zero():
    found = multisine((0.1, 0.2, 0.05), (0.1, 2.0), 20.0, 0.02)
    periodic = found.inputs[:-1]
    gram = periodic.T @ periodic
    assert gram / np.sqrt(np.outer(np.diag(gram), np.diag(gram))) == pytest.approx(np.eye(3), abs=1e-10)
    assert np.abs(found.inputs).max(axis=0) == pytest.approx([0.1, 0.2, 0.05])
    assert found.inputs[[0, -1]] == pytest.approx(np.zeros((2, 3)), abs=1e-9)
    spectrum = np.abs(np.fft.rfft(periodic, axis=0))
    for i, f in enumerate(found.harmonics_Hz):
        assert np.flatnonzero(spectrum[:, i] > 1e-6 * spectrum.max()) == pytest.approx(f * 20.0)


def test_the_phases_make_the_peaks_small():
    """1 is a single sine; random phases give about 2, and the literature calls 1.2 and less good."""
    assert multisine((1.0,), (0.1, 2.0), 20.0, 0.02).relative_peak_factor.max() < 1.2


def test_what_cannot_be_flown_is_refused():
    with pytest.raises(InputError, match="has 3 harmonics for 2 inputs"):
        multisine((1.0, 1.0), (0.1, 0.3), 10.0, 0.02)
    with pytest.raises(InputError, match="shorter than a sample"):
        three_two_one_one(0.05, 1.0, 0.04)
