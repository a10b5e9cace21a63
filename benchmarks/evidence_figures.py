"""Draws the figures of docs/evidence as SVG from the tables of `benchmarks/evidence.py`."""

import math
from collections.abc import Iterator, Sequence

from estimators import OVER_STALL
from records import Record

WIDTH, LEFT, RIGHT = 640, 150, 20
BLUE, ORANGE, RED = "#1f77b4", "#ff9d2e", "#d62728"
OF_MET = {"yes": BLUE, "open": ORANGE}
LEAST = 50  # start of the coverage axis, %
PERCENT = (0.5, 1, 2, 5, 10, 20)  # ticks of the error axis


def _svg(height: int, parts: Iterator[str]) -> str:
    size = f'viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="12"'
    body = "\n".join(parts)
    background = f'<rect width="{WIDTH}" height="{height}" fill="white"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{background}\n{body}\n</svg>\n'


def coverage_by_world(records: Sequence[Record], nominal: tuple[int, int]) -> str:
    """Draw the coverage of each world with twice its counting error, and the required band."""
    rows = sorted(records, key=lambda record: record["coverage, %"])
    step, height = 18, 18 * len(rows) + 40

    def x(share: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (min(max(share, LEAST), 100.0) - LEAST) / (100.0 - LEAST)

    def parts() -> Iterator[str]:
        low, high = nominal
        yield f'<rect x="{x(low):.0f}" y="8" width="{x(high) - x(low):.0f}" height="{height - 36}" fill="#d7ead7"/>'
        for i, row in enumerate(rows):
            y, share, error = 20 + step * i, row["coverage, %"], 2 * row["±"]
            yield f'<text x="{LEFT - 10}" y="{y + 4}" text-anchor="end">{row["world"]}</text>'
            yield f'<path d="M{x(share - error):.0f} {y}H{x(share + error):.0f}" stroke="#555"/>'
            yield f'<circle cx="{x(share):.0f}" cy="{y}" r="4" fill="{OF_MET.get(row["met"], RED)}"/>'
        for share in range(LEAST, 101, 10):
            yield f'<text x="{x(share):.0f}" y="{height - 8}" text-anchor="middle">{share} %</text>'

    return _svg(height, parts())


def error_by_speed(records: Sequence[Record], plan: str) -> str:
    """Draw a plan's flights by speed and weather: points below which 95 % of errors are, and half widths as lines."""
    rows, height = [record for record in records if record["plan"] == plan], 300

    def x(over_stall: float) -> float:
        share = (over_stall - OVER_STALL[0]) / (OVER_STALL[-1] - OVER_STALL[0])
        return LEFT - 80 + (WIDTH - LEFT - RIGHT) * share

    def y(percent: float) -> float:
        low, high = math.log(PERCENT[0]), math.log(PERCENT[-1])
        return height - 40 - (height - 60) * (math.log(max(percent, PERCENT[0])) - low) / (high - low)

    def parts() -> Iterator[str]:
        for percent in PERCENT:
            yield f'<path d="M{x(OVER_STALL[0]):.0f} {y(percent):.0f}H{x(OVER_STALL[-1]):.0f}" stroke="#ddd"/>'
            yield f'<text x="{LEFT - 90}" y="{y(percent) + 4:.0f}" text-anchor="end">{percent} %</text>'
        for speed in OVER_STALL:
            yield f'<text x="{x(speed):.0f}" y="{height - 20}" text-anchor="middle">{speed} V_stall</text>'
        for row, color in zip(rows, (BLUE, ORANGE, RED), strict=False):
            complete = [
                (s, e, h) for s, e, h in zip(OVER_STALL, row["error"], row["half width"], strict=True) if e and h
            ]
            line = " ".join(f"{x(speed):.0f},{y(half):.0f}" for speed, _, half in complete)
            yield f'<polyline points="{line}" fill="none" stroke="{color}" stroke-width="2"/>'
            for speed, error, _ in complete:
                yield f'<circle cx="{x(speed):.0f}" cy="{y(error):.0f}" r="4" fill="{color}"/>'
            speed, _, half = complete[-1]
            yield f'<text x="{x(speed) + 10:.0f}" y="{y(half) + 4:.0f}" fill="{color}">{row["W20, kt"]} kt</text>'

    return _svg(height, parts())
