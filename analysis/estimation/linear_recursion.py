"""The linear recursion S_(k+1) = A_k S_k + B_k of several records, over short blocks of all records at once."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK = 32  # samples


def solution(A: Array, B: Array, initial: Array, lengths: list[int]) -> Array:
    """S (n, s, m) of records of these lengths, one after another; the last step of each is not used.

    A : (n, s, s)     B : (n, s, m)     initial : (records, s, m), S at each record's first sample
    The solution of a block is linear in its first S: it is computed for all blocks together, then from block to block.
    """
    n, s, m = B.shape
    firsts, first_of_record, ends = [], [], []
    begin = 0
    for length in lengths:
        within = range(begin, begin + length, BLOCK)
        firsts += list(within)
        first_of_record += [True] + [False] * (len(within) - 1)
        begin += length
        ends += [begin] * len(within)
    samples = np.array(firsts)[:, None] + np.arange(BLOCK)
    used = samples < np.array(ends)[:, None]
    samples = np.minimum(samples, n - 1)  # a record's last block is filled up with samples that are not used
    both = np.zeros((BLOCK + 1, len(firsts), s, s + m))  # the factor of the block's first S, and what is added to it
    both[0, :, range(s), range(s)] = 1.0
    for k in range(BLOCK):
        np.matmul(A[samples[:, k]], both[k], out=both[k + 1])
        both[k + 1, :, :, s:] += B[samples[:, k]]
    factor, added = both[..., :s], both[..., s:]
    start = np.empty((len(firsts), s, m))
    records = iter(initial)
    for i, begins in enumerate(first_of_record):
        start[i] = next(records) if begins else factor[BLOCK, i - 1] @ start[i - 1] + added[BLOCK, i - 1]
    S = factor[:BLOCK] @ start + added[:BLOCK]
    return np.asarray(S.transpose(1, 0, 2, 3)[used])
