"""Options that several commands share."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flightpower.analysis.performance.request import Request, parse_request, parse_weight
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.command_line import Quantity
from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.units import GRAVITY_MPS2

if TYPE_CHECKING:
    from flightpower.analysis.air.contents import Replacements

QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
ReplaceOption = Annotated[bool, typer.Option("--replace", help="Replace an existing file.")]
AircraftOption = Annotated[
    Path | None, typer.Option("--aircraft", metavar="FILE", help="Aircraft file to use instead of the log's.")
]
PropellerOption = Annotated[
    str | None,
    typer.Option(
        "--propeller",
        metavar="NAME",
        help="Propeller to use instead of the log's: a name that `flightpower propellers` lists,"
        " a CSV file of its format, a PER3 file of APC, or tables of UIUC.",
    ),
]
ProbeOption = Annotated[
    Path | None, typer.Option("--probe", metavar="FILE", help="Probe calibration to use instead of the log's.")
]


def option_name(field: str) -> str:
    return f"--{field.replace('_', '-')}"


def refuse_drag_options(log: Path, why: str, **options: object) -> None:
    """Raises InputError for options that have no effect on a log without drag. why: reason, as a clause"""
    if names := _names_of_options_used(options):
        raise InputError(f"{log}: {names}: has no effect, since {why}; leave it out")


def refuse_autopilot_options(log: Path, options: "Options") -> None:
    """Raises InputError for options that have no effect on a log that contains an aircraft file."""
    if names := options.of_autopilots:
        raise InputError(f"{log}: {names}: only for logs of autopilots; give --weight, or --aircraft FILE")


def _names_of_options_used(options: dict[str, object]) -> str:
    return ", ".join(f"--{name.replace('_', '-')}" for name, value in options.items() if value is not None)


# Attachment of the log that each file replaces, by field of `LogOptions`; the option is the field's name with dashes.
ATTACHMENTS = {
    "aircraft": "aircraft.toml",
    "propeller": "propeller.csv",
    "probe": "probe.json",
    "magnetometer": "magnetometer.json",
    "transducers": "transducers.json",
    "thrust_stand": "thrust_stand.json",
    "airspeed": "airspeed.json",
    "zero": "zero.json",
}

OF_AUTOPILOTS = ("mass_kg", "wing_area_m2", "span_m", "air_temperature_K")


STRETCH = re.compile(r"\s*([\d.]+)\s*(?:s\s*)?(?:to|-|–)\s*([\d.]+)\s*s?\s*")


def parse_stretches(text: str, name: str) -> tuple[tuple[float, float], ...]:
    """Start and end [s] of each stretch of a list such as "120 to 180 s, 300 to 320 s", in order of time.

    Raises InputError, with a message that begins with `name`, for anything else.
    """
    stretches = []
    for part in text.split(","):
        stretch = STRETCH.fullmatch(part)
        try:
            start_s, end_s = (float(word) for word in stretch.groups()) if stretch else (1.0, 0.0)
        except ValueError:
            start_s, end_s = 1.0, 0.0
        if not start_s < end_s:
            raise InputError(
                f'{name}: {part.strip()[:40]!r} is not a stretch of time; write "120 to 180 s, 300 to 320 s"'
            )
        stretches.append((start_s, end_s))
    return tuple(sorted(stretches))


LEFT_OUT = "left_out.txt"  # file in the report's folder of a whole flight


def read_stretches(path: Path, name: str) -> tuple[tuple[float, float], ...]:
    """The stretches [s] in a file that `analyze` wrote; an empty file has none. Raises InputError for anything else."""
    text = read_text(path).strip().replace("\n", ", ")
    return parse_stretches(text, f"{name} {path}") if text else ()


def stretches_text(stretches_s: Iterable[tuple[float, float]]) -> str:
    """Write stretches as the list that `parse_stretches` reads, to a tenth of a second."""
    return ", ".join(f"{start:.1f} to {end:.1f} s" for start, end in sorted(stretches_s))


@dataclass(frozen=True)
class LogOptions:
    """Replacements for parts of a log; None where the log's own part is used."""

    aircraft: AircraftOption = None
    propeller: PropellerOption = None
    probe: ProbeOption = None
    zero: Annotated[
        Path | None,
        typer.Option("--zero", metavar="FILE", help="Still-air zero from `daq zero` to use instead of the log's."),
    ] = None
    weight_N: Annotated[
        float | None,
        typer.Option(
            "--weight",
            metavar="WEIGHT",
            parser=lambda text: parse_weight(text, "--weight"),
            help='Weight in this flight, such as "4.1 kg" or "9 lb", instead of the aircraft file\'s.',
        ),
    ] = None
    runs: Annotated[
        Path | None,
        typer.Option(
            "--runs",
            metavar="FILE",
            help="Runs to use: a runs.toml written by an earlier analysis and edited (keep, start, end, kind).",
        ),
    ] = None
    magnetometer: Annotated[
        Path | None,
        typer.Option("--magnetometer", metavar="FILE", help="Magnetometer calibration to use instead of the log's."),
    ] = None
    transducers: Annotated[
        Path | None,
        typer.Option(
            "--transducers",
            metavar="FILE",
            help="Calibration of the differential transducers to use instead of the log's.",
        ),
    ] = None
    thrust_stand: Annotated[
        Path | None,
        typer.Option(
            "--thrust-stand",
            metavar="FILE",
            help="Thrust at rest from `calibrate thrust` to use instead of the aircraft file's.",
        ),
    ] = None

    airspeed: Annotated[
        Path | None,
        typer.Option(
            "--airspeed",
            metavar="FILE",
            help="Scale of the airspeed, of `calibrate airspeed` in another flight with the same installation.",
        ),
    ] = None

    def replacements(self) -> "Replacements":
        """The contents of the files. Raises InputError when one of them, or the list of runs, cannot be used."""
        aircraft = load_aircraft(self.aircraft) if self.aircraft else None
        from flightpower.flight.propeller_files import load_propeller

        propeller = load_propeller(self.propeller) if self.propeller else None
        from flightpower.analysis.air.airspeed_scale import AIRSPEED_FILE
        from flightpower.analysis.air.contents import Replacements
        from flightpower.analysis.air.magnetometer import MAGNETOMETER_FILE
        from flightpower.analysis.air.probe import PROBE_FILE
        from flightpower.analysis.air.thrust_stand import THRUST_STAND_FILE
        from flightpower.analysis.air.transducers import TRANSDUCERS_FILE
        from flightpower.analysis.maneuvers import runs_file
        from flightpower.analysis.sources.rest import ZERO_FILE

        if self.runs:
            runs_file.load(self.runs)  # a wrong list is refused before anything is computed
        paths = ((attachment, getattr(self, field)) for field, attachment in ATTACHMENTS.items())
        return Replacements(
            aircraft=aircraft,
            propeller=propeller,
            probe=PROBE_FILE.load(self.probe) if self.probe else None,
            magnetometer=MAGNETOMETER_FILE.load(self.magnetometer) if self.magnetometer else None,
            transducers=TRANSDUCERS_FILE.load(self.transducers) if self.transducers else None,
            thrust_stand=THRUST_STAND_FILE.load(self.thrust_stand) if self.thrust_stand else None,
            airspeed=AIRSPEED_FILE.load(self.airspeed) if self.airspeed else None,
            zero=ZERO_FILE.load(self.zero).by_channel() if self.zero else None,
            weight_N=self.weight_N,
            files={attachment: str(path) for attachment, path in paths if path is not None},
        )


@dataclass(frozen=True)
class Options(LogOptions):
    """The options of `analyze`, for each log; `analyze --help` explains them.

    Files, each a path: `aircraft`, `probe`, `zero`, `runs`, `magnetometer`, `transducers`, `thrust_stand`, `airspeed`,
    `columns`, `polar`; `propeller` is a name or a path. Numbers above zero: `weight_N` or `mass_kg`, `wing_area_m2`,
    `span_m`, `air_temperature_K`. Texts as on the command line: `battery_Wh`, `usable`, `weights`, `density_altitudes`,
    `leave_out`. `likelihood` is True or False. Raises InputError for numbers and texts that do not fit.
    """

    columns: Annotated[
        Path | None,
        typer.Option(
            "--columns",
            metavar="FILE",
            help="Map of the columns of a table (CSV, Parquet, .mat), from `flightpower new columns`; default:"
            " LOG.columns.toml or columns.toml beside it.",
        ),
    ] = None
    polar: Annotated[
        Path | None,
        typer.Option(
            "--polar",
            metavar="FILE",
            help="Drag polar that XFLR5, AVL or AeroSandbox predicted, to draw beside the measured one.",
        ),
    ] = None
    likelihood: Annotated[
        bool,
        typer.Option(
            "--likelihood",
            help="Also apply the two maximum-likelihood methods of the source (docs/understand/methods.md);"
            " for a flight of 20 minutes this takes half a minute.",
        ),
    ] = False
    battery_Wh: Annotated[
        str | None,
        typer.Option(
            "--battery-Wh",
            metavar="ENERGY",
            help='Energy of the battery [Wh], such as 74, or "5000 mAh, 14.8 V"; default: that of the aircraft file.',
        ),
    ] = None
    usable: Annotated[
        str | None,
        typer.Option("--usable", metavar="SHARE", help="Usable share of that energy; default: 0.8, which is 80%."),
    ] = None
    weights: Annotated[
        str | None,
        typer.Option(
            "--weights",
            metavar="LIST",
            help='Weights to compute, such as "3.8 kg, 9 lbf"; default: 300 and 600 g more than flown.',
        ),
    ] = None
    density_altitudes: Annotated[
        str | None,
        typer.Option(
            "--density-altitudes",
            metavar="LIST",
            help='Density altitudes to compute, such as "0 m, 5000 ft"; default: 15 °C hotter and 1000 m higher.',
        ),
    ] = None
    mass_kg: Annotated[
        float | None,
        Quantity("--mass", "kg", '"9 lb"', least=0.01, most=1000).as_option(
            'Mass [kg], such as 9.4 or "21 lb", for a log of an autopilot.'
        ),
    ] = None
    wing_area_m2: Annotated[
        float | None,
        Quantity("--wing-area", "m^2", '"5 ft^2"', above=0, most=200).as_option(
            'Wing area [m^2], such as 1.5 or "16 ft^2", for a log of an autopilot.'
        ),
    ] = None
    span_m: Annotated[
        float | None,
        Quantity("--span", "m", '"13 ft"', above=0, most=100).as_option(
            'Span [m], such as 4 or "13 ft", for a log of an autopilot.'
        ),
    ] = None
    air_temperature_K: Annotated[
        float | None,
        Quantity("--air-temperature", "K", '"20 degC"', above=200, most=340).as_option(
            'Air temperature in flight, such as "20 degC", for a log of an autopilot.'
        ),
    ] = None

    leave_out: Annotated[
        str | None,
        typer.Option(
            "--leave-out",
            metavar="LIST",
            help='Stretches to leave out of the energy balance of a whole flight, such as "120 to 180 s, 300 to 320 s",'
            " counted from the start of the log as in the report's figures; or the left_out.txt of an earlier report.",
        ),
    ] = None

    def __post_init__(self) -> None:
        """Refuse wrong numbers, which no parser checks if a program gives them, and wrong texts at once."""
        for name in ("weight_N", "mass_kg", "wing_area_m2", "span_m", "air_temperature_K"):
            value = getattr(self, name)
            if value is not None and not (isinstance(value, int | float) and 0 < value < math.inf):
                raise InputError(f"Options: {name} = {value!r}: give a number above zero, in the unit of its name")
        for name in ("battery_Wh", "usable", "weights", "density_altitudes", "leave_out"):
            value = getattr(self, name)
            if value is not None and not isinstance(value, str):
                raise InputError(f"Options: {name} = {value!r}: give a text, as to the command, such as '{value}'")
        self.left_out_s  # noqa: B018
        self.request  # noqa: B018  # a wrong text is refused at once

    @cached_property
    def request(self) -> Request:
        """Battery, weights and density altitudes to compute performance for."""
        return parse_request(self.battery_Wh, self.usable, self.weights, self.density_altitudes)

    @cached_property
    def left_out_s(self) -> tuple[tuple[float, float], ...]:
        """Start and end [s] of each stretch of --leave-out, which is a list or a file of one, in order of time."""
        if self.leave_out is not None and self.leave_out.endswith(".txt"):
            return read_stretches(Path(self.leave_out), "--leave-out")
        return parse_stretches(self.leave_out, "--leave-out") if self.leave_out is not None else ()

    @property
    def flown_weight_N(self) -> float | None:
        """Weight [N] from --weight or --mass; None if neither is given."""
        return self.weight_N if self.mass_kg is None else self.mass_kg * GRAVITY_MPS2

    @property
    def of_autopilots(self) -> str:
        """Names of the options given that only affect a log without its own aircraft file; empty if there are none."""
        return _names_of_options_used({name.rpartition("_")[0]: getattr(self, name) for name in OF_AUTOPILOTS})

    def with_own_aircraft(self) -> "Options":
        """These options without those that only affect a log without its own aircraft file."""
        return replace(self, mass_kg=None, wing_area_m2=None, span_m=None, air_temperature_K=None)

    def for_drag(self) -> dict[str, object]:
        """The options that only affect the analysis of runs, by name; None for those not given."""
        names = ("probe", "zero", "runs", "magnetometer", "transducers", "thrust_stand", "polar")
        return {name: getattr(self, name) for name in names} | {"likelihood": self.likelihood or None}
