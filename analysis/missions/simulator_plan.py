"""A flight plan as TOML, for `sim fly --plan`."""

from collections.abc import Sequence
from math import degrees

from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft
from flightpower.analysis.missions.information import QUESTION_TITLES
from flightpower.analysis.missions.pieces import Hold, Land, Maneuver, Porpoise, Run, Stand, TakeOff, Turn
from flightpower.analysis.missions.search import Request
from flightpower.analysis.missions.time_history import climb_rate_mps
from flightpower.flight.runs import AIRCRAFT_SIZE
from flightpower.flight.units import KNOT_MPS


def simulator_plan(maneuvers: Sequence[Maneuver], aircraft: ExpectedAircraft, request: Request) -> str:
    """Return the text of the file, with the wind and the turbulence that the plan was made for."""
    kt = request.wind_kt
    lines = [
        f'title = "Planned for {QUESTION_TITLES[request.question]}, {request.minutes:g} min"',
        "",
        "[air]",
        f'wind = "{kt * KNOT_MPS:.2f} m/s"',
        f'wind_from = "{request.wind_from_leg_deg % 360:.0f} deg"',
        f'turbulence = "{kt * KNOT_MPS:.3f} m/s"',
    ]
    for maneuver in maneuvers:
        for segment in _segments(maneuver, aircraft, request.space.height_m):
            lines += ["", "[[segment]]", *(f"{key} = {_value(value)}" for key, value in segment.items())]
    return "\n".join(lines) + "\n"


def _value(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def _segments(maneuver: Maneuver, aircraft: ExpectedAircraft, height_m: float) -> list[dict[str, object]]:
    rate_mps = climb_rate_mps(aircraft)

    def climb(to_m: float, speed_mps: float) -> dict[str, object]:
        return {
            "kind": "climb",
            "height": f"{to_m:g} m",
            "climb": f"{rate_mps:.2f} m/s",
            "speed": f"{speed_mps:.2f} m/s",
        }

    match maneuver:
        case Stand(duration_s):
            return [{"kind": "stand", "duration": f"{duration_s:g} s"}]
        case TakeOff(speed_mps):
            return [{"kind": "take-off"}, climb(height_m, speed_mps)]
        case Hold(duration_s, speed_mps):
            return [{"kind": "hold", "duration": f"{duration_s:.1f} s", "speed": f"{speed_mps:.2f} m/s"}]
        case Turn(speed_mps, angle_rad, bank_rad):
            return [
                {
                    "kind": "turn",
                    "angle": f"{degrees(angle_rad):.1f} deg",
                    "bank": f"{degrees(bank_rad):.0f} deg",
                    "speed": f"{speed_mps:.2f} m/s",
                }
            ]
        case Run():
            return [
                {
                    "kind": "run",
                    "throttle": maneuver.throttle,
                    "ramp": f"{maneuver.ramp_s:g} s",
                    "longest": f"{maneuver.longest_s:g} s",
                    "speed": f"{maneuver.until_mps:.2f} m/s",
                }
            ]
        case Porpoise():
            return [
                {
                    "kind": "porpoise",
                    "duration": f"{maneuver.duration_s:.1f} s",
                    "speed": f"{maneuver.speed_mps:.2f} m/s",
                    "elevator": "8 deg",  # initially; the simulator's pilot adapts it to the requested load factor
                    "load": round(maneuver.load, 3),
                    "first_period": f"{maneuver.first_period_s:g} s",
                    "last_period": f"{maneuver.last_period_s:g} s",
                }
            ]
        case Land(speed_mps):
            return [climb(min(AIRCRAFT_SIZE.least_height_m, height_m), speed_mps), {"kind": "land"}]
    raise AssertionError(maneuver)
