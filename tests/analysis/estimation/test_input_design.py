"""Inputs for manoeuvres: steps, and multisines."""

import numpy as np
import pytest

from analysis.estimation.input_design import doublet, multisine, three_two_one_one
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
