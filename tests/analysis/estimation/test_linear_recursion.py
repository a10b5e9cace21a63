"""The recursion over blocks gives the numbers of a plain loop."""

import numpy as np
import pytest

from flightpower.analysis.estimation.simulation import linear_recursion

RECURSION_BLOCK = 32


def by_a_loop(A, B, initial, lengths):
    rows, begin = [], 0
    for S, length in zip(initial, lengths, strict=True):
        for k in range(begin, begin + length):
            rows.append(S)
            S = A[k] @ S + B[k]
        begin += length
    return np.array(rows)


@pytest.mark.parametrize(
    "lengths",
    [[1], [RECURSION_BLOCK], [RECURSION_BLOCK + 1], [3 * RECURSION_BLOCK - 1, 1, 2 * RECURSION_BLOCK, 5]],
    ids=["one sample", "one block", "a block and a sample", "records that end within, after and at the end of a block"],
)
def test_it_gives_the_numbers_of_a_loop(lengths):
    rng = np.random.default_rng(0)
    n, s, m = sum(lengths), 3, 5
    A = 0.9 * np.linalg.qr(rng.standard_normal((n, s, s)))[0]
    B, initial = rng.standard_normal((n, s, m)), rng.standard_normal((len(lengths), s, m))
    S = linear_recursion(A, B, initial, lengths, block=RECURSION_BLOCK)
    assert S.shape == (n, s, m)
    assert S == pytest.approx(by_a_loop(A, B, initial, lengths), rel=1e-12, abs=1e-12)


def test_the_last_step_of_a_record_does_not_reach_the_next():
    lengths, item = [RECURSION_BLOCK, 4], np.ones((RECURSION_BLOCK + 4, 1, 1))
    A, B = item.copy(), item.copy()
    A[RECURSION_BLOCK - 1] = B[RECURSION_BLOCK - 1] = np.inf
    assert linear_recursion(A, B, np.zeros((2, 1, 1)), lengths)[:, 0, 0].tolist() == [
        *range(RECURSION_BLOCK),
        *range(4),
    ]
