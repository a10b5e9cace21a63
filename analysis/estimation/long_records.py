"""Information and gradient of output error on long records, summed block by block without keeping sensitivities.

With a diagonal R both are sums over the outputs, each divided by the output's variance: one pass over the record gives
the sums, and R follows from the residuals afterwards.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.simulation import Record, Response, Simulator

Array = NDArray[np.float64]

BLOCK = 4096  # samples


@dataclass(frozen=True)
class Sums:
    """Of one segment, over its samples, for each output.

    y : (n, outputs) response     residuals : (n, outputs) z - y, NaN where missing
    gram : (outputs, unknowns, unknowns) of S_i S_j     product : (outputs, unknowns) of S_i times the residual
    """

    y: Array
    residuals: Array
    gram: Array
    product: Array


def responses_in_blocks(simulator: Simulator, records: Iterable[Record]) -> Iterator[Iterable[Response]]:
    """The blocks of each record's response; short records are computed together."""
    together: list[Record] = []
    for record in records:
        if together and sum(len(short.U) for short in together) + len(record.U) > BLOCK:
            yield from ([response] for response in simulator.run_all(together))
            together = []
        if len(record.U) > BLOCK:
            yield simulator.run_in_blocks(*record, BLOCK)
        else:
            together.append(record)
    if together:
        yield from ([response] for response in simulator.run_all(together))


def summed(blocks: Iterable[Response], Z: Array, kept: NDArray[np.intp]) -> Sums | None:
    """The sums over a record; None if the response is not finite. kept : unknowns among those of the simulator."""
    y, residuals = np.empty_like(Z), np.empty_like(Z)
    gram, product = np.zeros((Z.shape[1], len(kept), len(kept))), np.zeros((Z.shape[1], len(kept)))
    first = 0
    for block in blocks:
        if not (np.isfinite(block.y).all() and np.isfinite(block.S).all()):
            return None
        rows = slice(first, first + len(block.y))
        first = rows.stop
        y[rows] = block.y
        residuals[rows] = Z[rows] - block.y
        e = np.nan_to_num(residuals[rows])
        present = np.isfinite(residuals[rows])
        for i in range(Z.shape[1]):
            S = np.ascontiguousarray(block.S[:, i, kept]) * present[:, i, None]
            gram[i] += S.T @ S
            product[i] += S.T @ e[:, i]
    return Sums(y, residuals, gram, product)
