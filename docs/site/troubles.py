"""The page "Something went wrong" of the site, made from the tables of messages in the code, and from its refusals.

python docs/site/troubles.py            # prints the page
"""

import ast
import sys
from collections.abc import Iterator, Mapping
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from flightpower.analysis.maneuvers.kinds import Unsuitable  # noqa: E402
from flightpower.analysis.missions.flown import INSTEAD  # noqa: E402
from flightpower.analysis.missions.items import Command  # noqa: E402
from flightpower.analysis.performance.autopilot_parameters import WITHOUT  # noqa: E402
from flightpower.analysis.records.flight import EvidenceKind, MethodRejection  # noqa: E402
from flightpower.analysis.results.evidence import CULPRIT  # noqa: E402
from flightpower.analysis.sources.laws import Mistake  # noqa: E402
from flightpower.analysis.trajectory.observability import SENSOR_ERROR_KINDS, MissingExcitation  # noqa: E402
from flightpower.daq.tray_check import ADVICE, GOOD_STATUSES  # noqa: E402
from flightpower.flight.command_line import ExitCode  # noqa: E402
from flightpower.flight.messages import Status  # noqa: E402
from flightpower.flight.runs import RunRejected  # noqa: E402

HEAD = """\
# Something went wrong

Every refusal, doubt and status that flightpower knows, with what to do; made from the code. Search this page (Ctrl-F)
for the words of a message; `…` stands for names and numbers.
"""


class Trouble(NamedTuple):
    """The cause, and what to do."""

    cause: str
    remedy: str


EXITS: Mapping[ExitCode, Trouble] = {
    ExitCode.DONE: Trouble("Done. A doubtful result is named first.", "Read what is in doubt before you use it."),
    ExitCode.FAILURE: Trouble(
        "It failed while running, the disk is full, or the result is not to be trusted.",
        "Do what the lines on stderr say.",
    ),
    ExitCode.BAD_INPUT: Trouble(
        "The input cannot be used: one line on stderr says what is wrong, where, and what to do.",
        "Change it; nothing was written.",
    ),
}
POLES = "Check `propulsion.pole_pairs`, the pulses of the motor speed, the propeller and its table."
EVIDENCE: Mapping[EvidenceKind, Trouble] = {
    EvidenceKind.NOT_CONVERGED: Trouble(
        "The drag polar has no unique solution: too few runs, or at one speed only.", "Fly more runs, slow to fast."
    ),
    EvidenceKind.TRAJECTORY_NOT_CONVERGED: Trouble(
        "No flight path explains all measurements.", "Check units, axes and delays of the log, and the aircraft file."
    ),
    EvidenceKind.METHOD_FAILED: Trouble(
        "The flight has runs, but no method gives drag from them.",
        "Check weight, wing area, propeller and its table, pole pairs, and units and delays of the log.",
    ),
    EvidenceKind.COUNTED_SPEED: Trouble("Pulses of the motor are lost, or counted with wrong poles.", POLES),
    EvidenceKind.MOTOR_LAG: Trouble(
        "Motor speed is late against the IMU: a filter in the controller, or a late clock.",
        "State the delay in the tray file, or turn the filter off.",
    ),
    EvidenceKind.OTHER_BLADES: Trouble(
        "In decelerations the propeller's drag differs from what the aircraft file says.",
        "Set `propulsion.beyond_zero_thrust`: do the blades fold, windmill or stop?",
    ),
    EvidenceKind.THRUST_TABLE: Trouble("Thrust is not that of the propeller's table.", POLES),
    EvidenceKind.MOTOR_SPEED: Trouble(
        "At full throttle the motor turns unlike its kv says.", "Check kv, battery voltage and `propulsion.pole_pairs`."
    ),
    EvidenceKind.PROPELLER_EFFICIENCY: Trouble("Better than any propeller.", f"{POLES} Check the weight."),
    EvidenceKind.MOTOR_EFFICIENCY: Trouble(
        "The shaft gives more than the battery.", f"{POLES} Check the power module."
    ),
    EvidenceKind.THRUST_EFFICIENCY: Trouble(
        "Less or more of the battery's energy becomes thrust than in any aircraft.",
        "Calibrate the power module's current; check the weight.",
    ),
    EvidenceKind.LIFT_COEFFICIENT: Trouble(
        "No wing carries this weight at the slowest speed flown.", "Check mass, wing area and airspeed."
    ),
    EvidenceKind.IMPLAUSIBLE_READINGS: Trouble(
        "Two sensors contradicted each other in flight.", "Look at the events in the log: a blocked or leaking line."
    ),
    EvidenceKind.SENSOR_ERROR: Trouble(
        "A sensor is off by more than its prior allows.", "See the table of sensor errors below."
    ),
    EvidenceKind.SENSOR_ERRORS_TOGETHER: Trouble(
        "Several sensors are off, none beyond its own limit.",
        "They may have one cause: rising or sinking air, or an instrument that is mounted wrong.",
    ),
    EvidenceKind.RUN_AGAINST_OTHERS: Trouble(
        "One run differs from the others.",
        "Check it for gear, flaps, a thermal or lost pulses; leave it out in `runs.toml`.",
    ),
    EvidenceKind.INSTALLATIONS_DIFFER: Trouble(
        "The probe was moved between flights that are said to be of one installation.", "Say so in the aircraft files."
    ),
    EvidenceKind.FLIGHTS_DIFFER: Trouble(
        "One flight differs from the others.", "Check weight, propeller and damage on that day; analyze it alone."
    ),
    EvidenceKind.OUTSIDE_TABLE: Trouble(
        "The flight left the propeller's table.", "Get a table that has these speeds: `flightpower propellers`."
    ),
    EvidenceKind.INTERVAL_REACHES_ZERO: Trouble(
        "The flight says too little.", "Fly longer, more runs, on a calmer day."
    ),
    EvidenceKind.POLAR_CURVES_DOWNWARD: Trouble(
        "Drag falls with the square of lift, which no wing does.",
        "Fly slower and faster runs; check the angle of attack.",
    ),
    EvidenceKind.CROSS_CHECK: Trouble(
        "Another method gives another curve.", "The report names the likely cause: angle of attack, airspeed or a lag."
    ),
    EvidenceKind.NO_VERDICT: Trouble("The results are of an earlier version.", "Analyze the log again."),
}
METHODS: Mapping[MethodRejection, Trouble] = {
    MethodRejection.NOT_FLOWN: Trouble(
        "No runs in the log, or none that can be used.", "Look at the rejected stretches below."
    ),
    MethodRejection.NO_TRAJECTORY: Trouble(
        "The measurements contradict each other.", "Check units, axes and clocks of the log."
    ),
    MethodRejection.MISFIT: Trouble(
        "A channel has a wrong unit, sign or delay.", "Check units, axes and delays of the log."
    ),
    MethodRejection.NO_ESTIMATE: Trouble("Too few data.", "Fly more runs."),
    MethodRejection.UNPHYSICAL: Trouble("Weight, thrust or airspeed are wrong.", POLES),
    MethodRejection.NO_INFORMATION: Trouble(
        "Too little lift, speed or thrust was varied.", "Fly slow to fast, and longer."
    ),
}
REJECTED: Mapping[StrEnum, Trouble] = {
    RunRejected.TOO_GENTLE: Trouble("The throttle moved too slowly.", "Open it over 8 to 13 s."),
    RunRejected.TOO_SHORT: Trouble("Less than five seconds.", "Hold the throttle longer; start slower."),
    RunRejected.TOO_LONG: Trouble("More than forty seconds.", "Open the throttle faster."),
    RunRejected.SPEED_CHANGED_LITTLE: Trouble("Less than a fifth.", "Start slower, end faster."),
    RunRejected.HEIGHT_UNKNOWN: Trouble("No barometer.", "Record static pressure."),
    RunRejected.TOO_LOW: Trouble("Near the ground its effect counts.", "Fly higher than 20 m."),
    RunRejected.CLIMBED: Trouble("The run was not level.", "Hold the height; trim before the run."),
    RunRejected.HEIGHT_VARIED: Trouble("The run was not level.", "Hold the height within a few meters."),
    RunRejected.BANKED: Trouble("The run was flown in a turn.", "Keep the wings level until it ends."),
    RunRejected.DATA_MISSING: Trouble("A sensor did not measure.", "Look for its status in the log: `daq info`."),
    Unsuitable.SPEED_DRIFTED: Trouble("Speed was not held.", "Hold it for ten seconds and more."),
    Unsuitable.SPEED_CHANGED: Trouble("Speed was not held.", "Hold it within the maneuver."),
    Unsuitable.MOTOR_STOPPED: Trouble("Its thrust is not known.", "Leave some throttle."),
    Unsuitable.MOTOR_VARIED: Trouble("Thrust was not steady.", "Leave the throttle where it is."),
    Unsuitable.PORPOISE_TOO_GENTLE: Trouble(
        "The load factor swung too little.", "Move the stick farther, 1.5 s a cycle."
    ),
    Unsuitable.LOAD_NOT_STEADY: Trouble("Bank or load changed.", "Hold the bank."),
    Unsuitable.LOAD_VARIED: Trouble("Bank or load changed.", "Hold the bank."),
    Unsuitable.NOT_FLYING: Trouble("The aircraft stood or rolled.", "Nothing: it is no maneuver."),
    Unsuitable.NO_3211: Trouble("The steps of the elevator do not have this form.", "Fly 3, 2, 1, 1 periods."),
    Unsuitable.LEFT_OUT: Trouble("`keep = false` in `runs.toml`.", "Set it to true to use it."),
}
MISTAKES: Mapping[Mistake, Trouble] = {
    Mistake.RANGE: Trouble("No aircraft has such values.", "Correct column or unit in the map."),
    Mistake.UNIT: Trouble(
        "The ratio to the value from the laws of motion is the ratio of two units.", "Correct the unit in the map."
    ),
    Mistake.SIGN: Trouble("It falls where it should rise.", "Write the column with a minus, or the other axis."),
    Mistake.DELAY: Trouble("Its values lag behind the other channels.", "Give its delay in the map."),
    Mistake.EXCHANGED: Trouble("Two columns fit each other's place.", "Exchange them in the map."),
    Mistake.UNRELATED: Trouble(
        "Its values have nothing to do with the quantity it is mapped to.", "Name another column, or delete the line."
    ),
}
AREAS = {
    "analysis/sources": "Logs and tables",
    "analysis/air": "Air data and calibrations in a log",
    "analysis/maneuvers": "Runs and other maneuvers",
    "analysis/methods": "Estimation of the curve",
    "analysis/estimation": "Parameter estimation (programs)",
    "analysis/trajectory": "Flight path",
    "analysis/performance": "Endurance, range, battery",
    "analysis/flights": "Many flights",
    "analysis/missions": "Plans and routes",
    "analysis/calibrations": "Calibrations",
    "analysis/pages": "Reports, exports, the page in the browser",
    "analysis": "Commands on the laptop",
    "daq": "The recorder on the aircraft",
    "flight": "Files, units, aircraft, propellers",
    "flightpower": "The command flightpower",
    "sim": "The simulator",
    "hw_fakes": "Fake sensors",
}
REFUSALS = ("InputError", "StorageError", "DeviceInUse", "NoCurve")


class Message(NamedTuple):
    """A refusal: the folder of its module, its words with … for what varies."""

    area: str
    text: str


def page() -> str:
    """The whole page as Markdown."""
    sections = {
        "Exit codes": _rows((str(int(code)), EXITS[code]) for code in ExitCode),
        "Doubts about a result": _rows((str(kind), EVIDENCE[kind]) for kind in EvidenceKind),
        "Sensor errors larger than assumed": _table(
            (SENSOR_ERROR_KINDS[name].title, culprit) for name, culprit in CULPRIT.items()
        ),
        "What a flight does not determine, and why": _table(
            (lacking.name.lower(), str(lacking)) for lacking in MissingExcitation
        ),
        "Methods that do not give the curve": _rows(
            (str(why), METHODS[why]) for why in MethodRejection if why is not MethodRejection.NONE
        ),
        "Stretches that are no maneuver": _rows((str(why), REJECTED[why]) for why in (*RunRejected, *Unsuitable)),
        "Columns of a table": _rows((str(mistake), MISTAKES[mistake]) for mistake in Mistake),
        "Sensors of the tray": _table(
            (str(status), ADVICE[status]) for status in Status if status not in GOOD_STATUSES
        ),
        "Items of a mission": _table((f"{Command(item).name} ({item})", text) for item, text in INSTEAD.items()),
        "Values for an autopilot": _table((name, text.format(takes="it takes")) for name, text in WITHOUT.items()),
    }
    parts = [HEAD, *(f"## {title}\n\n{table}" for title, table in sections.items()), "## All refusals\n"]
    all_messages = sorted(set(messages()))
    for area, title in AREAS.items():
        own = [_cells(message.text) for message in all_messages if message.area == area]
        if own:
            parts.append(f"### {title}\n\n{_table(own, ('message', 'what to do'))}")
    return "\n".join(parts)


def messages() -> Iterator[Message]:
    """Every refusal message in the code."""
    for package in ("analysis", "daq", "flight", "flightpower", "sim", "hw_fakes"):
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            area = max((area for area in AREAS if name.startswith(f"{area}/")), key=len)
            source = path.read_text("utf-8")
            if not any(f"{name}(" in source for name in REFUSALS):
                continue
            for node in ast.walk(ast.parse(source)):
                if (
                    isinstance(node, ast.Call)
                    and isinstance(node.func, ast.Name)
                    and node.func.id in REFUSALS
                    and node.args
                ):
                    text = _words(node.args[0])
                    if text.strip("… :.;") != "":
                        yield Message(area, text)


def _words(node: ast.expr) -> str:
    """Return a message's text, with … in place of each part that varies."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(_words(value) for value in values)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _words(left) + _words(right)
        case ast.IfExp(body=body):
            return _words(body)
    return "…"


def _cells(text: str) -> tuple[str, str]:
    """What is wrong, and what to do: the part after the last semicolon."""
    wrong, _, remedy = text.rpartition("; ")
    return (wrong, remedy) if wrong else (remedy, "")


def _rows(troubles: Iterator[tuple[str, Trouble]]) -> str:
    return _table(
        ((name, trouble.cause, trouble.remedy) for name, trouble in troubles), ("what", "cause", "what to do")
    )


def _table(
    rows: "Iterator[tuple[str, ...]] | list[tuple[str, ...]]", head: tuple[str, ...] = ("what", "what to do")
) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(_cell(cell) for cell in line)} |" for line in lines) + "\n"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


if __name__ == "__main__":
    print(page())
