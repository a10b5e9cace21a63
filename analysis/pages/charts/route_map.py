"""The map, an SVG image with north up: the route, and how far the aircraft can go and return in every direction."""

from collections.abc import Iterable, Sequence
from math import cos, radians, sin
from typing import NamedTuple

from flightpower.analysis.missions.mission import Mission, Wind
from flightpower.analysis.missions.prediction import Direction, RouteResult
from flightpower.analysis.pages.charts.style import BLUE, GRAY, ORANGE, round_length


class Layout(NamedTuple):
    """Layout of the image in its own units: side length, and the radius that contains everything."""

    side: float = 640.0
    room: float = 280.0


LAYOUT = Layout()


def map_svg(result: RouteResult, mission: Mission, wind: Wind) -> str:
    """Draw safe and median reach, the route from its start, home in the middle, a scale and a wind arrow."""
    places = [mission.start, *(step.to for step in mission.steps)]
    farthest_m = max(
        *(direction.radius_m for direction in result.directions),
        *(abs(p.east_m) for p in places),
        *(abs(p.north_m) for p in places),
    )
    scale = LAYOUT.room / max(farthest_m, 1.0)

    def point(east_m: float, north_m: float) -> tuple[float, float]:
        return LAYOUT.side / 2 + scale * east_m, LAYOUT.side / 2 - scale * north_m

    def reach(radii: Iterable[tuple[Direction, float]]) -> list[tuple[float, float]]:
        return [point(r * sin(radians(leg.course_deg)), r * cos(radians(leg.course_deg))) for leg, r in radii]

    ring_m = round_length(farthest_m / 2)
    x, y = point(0.0, 0.0)
    parts = [
        _polygon(
            reach((direction, direction.radius_m) for direction in result.directions),
            f'stroke="{GRAY}" stroke-dasharray="6 4"',
        ),
        _polygon(
            reach((direction, direction.safe_radius_m) for direction in result.directions),
            f'stroke="{BLUE}" stroke-width="2"',
        ),
        _line([point(place.east_m, place.north_m) for place in places], ORANGE),
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="black"/>',
        _line([(40, LAYOUT.side - 30), (40 + scale * ring_m, LAYOUT.side - 30)], "black"),
        _text(40, LAYOUT.side - 38, f"{ring_m / 1000:g} km"),
        _text(
            40, 30, f"out and back: blue {100 * result.sure:.0f} % sure, gray median; orange: the route; north is up"
        ),
    ]
    if wind.mps > 0:
        length = 50 / wind.mps
        tip = (LAYOUT.side - 70 + length * wind.east_mps, 80 - length * wind.north_mps)
        tail = (LAYOUT.side - 70 - length * wind.east_mps, 80 + length * wind.north_mps)
        parts += [
            '<marker id="tip" viewBox="0 0 6 6" refX="5" refY="3" markerWidth="6" markerHeight="6" orient="auto">'
            '<path d="M0 0L6 3L0 6z"/></marker>',
            f'<line x1="{tail[0]:.1f}" y1="{tail[1]:.1f}" x2="{tip[0]:.1f}" y2="{tip[1]:.1f}" stroke="black"'
            ' stroke-width="2" marker-end="url(#tip)"/>',
            _text(LAYOUT.side - 120, 150, f"wind {wind.mps:.1f} m/s"),
        ]
    body, side = "\n".join(parts), f"{LAYOUT.side:.0f}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {side} {side}" font-family="sans-serif" font-size="14">'
        f'\n<rect width="100%" height="100%" fill="white"/>\n{body}\n</svg>\n'
    )


def _points(points: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _polygon(points: Sequence[tuple[float, float]], style: str) -> str:
    return f'<polygon points="{_points(points)}" fill="none" {style}/>'


def _line(points: Sequence[tuple[float, float]], color: str) -> str:
    return f'<polyline points="{_points(points)}" fill="none" stroke="{color}" stroke-width="2"/>'


def _text(x: float, y: float, text: str) -> str:
    """Return text with a white outline, since it may lie over a line."""
    return f'<text x="{x:.0f}" y="{y:.0f}" paint-order="stroke" stroke="white" stroke-width="4">{text}</text>'
