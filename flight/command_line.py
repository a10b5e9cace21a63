"""Code that the commands share: plain help, records of options, quantities with units, exit codes.

A command reports wrong input in one line on stderr.
"""

import inspect
import math
import os
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, fields
from enum import IntEnum
from io import TextIOWrapper
from typing import Annotated, Any, TypeVar, get_type_hints

import typer

from flightpower.flight.errors import STORAGE_FAILS, InputError, StorageError
from flightpower.flight.units import number_or_nan, to_si
from flightpower.flight.version import version

Record = TypeVar("Record")


class ExitCode(IntEnum):
    """How a command ended. Ctrl-C gives 130."""

    DONE = 0
    FAILURE = 1  # a failure while running, or a result that should not be trusted
    BAD_INPUT = 2  # wrong input or configuration


UsageError: Any = typer.BadParameter.__mro__[1]  # typer's versions name this class differently
LINUX_ONLY = ("fcntl", "resource", "termios")


def application(**options: Any) -> typer.Typer:
    """A Typer application whose help is plain text, without boxes or markup, which would swallow units in brackets."""
    defaults: dict[str, Any] = {"add_completion": False, "no_args_is_help": True}
    return typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, **defaults | options)


def run(app: typer.Typer, name: str, prefix: str = "error") -> None:
    """Run the command `name`. Wrong input is reported in one line on stderr that begins with `prefix`."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # replaces characters that the terminal's encoding lacks
    if not _is_count(os.environ.get("COLUMNS", "1")):  # as for a terminal that does not report its width
        del os.environ["COLUMNS"]
    try:
        _check_encoding(sys.argv[1:])
        code = command_of(app)(prog_name=name, standalone_mode=False)
        sys.stdout.flush()
    except UsageError as error:
        _stop(prefix, _usage(error, name))
    except StorageError as error:
        _stop(prefix, str(error), ExitCode.FAILURE)
    except InputError as error:
        _stop(prefix, str(error))
    except ModuleNotFoundError as error:
        if error.name not in LINUX_ONLY:
            raise
        _stop(prefix, f"{name}: runs on Linux only, on the aircraft's computer ({error.name} is missing)")
    except BrokenPipeError:
        _discard_output()
        sys.exit(ExitCode.FAILURE)
    except OSError as error:
        named = isinstance(error.filename, str)
        if not named and error.errno not in STORAGE_FAILS:
            raise
        if not named:
            _discard_output()
        code = ExitCode.FAILURE if error.errno in STORAGE_FAILS else ExitCode.BAD_INPUT
        what = f"{error.filename}: cannot be read or written" if named else "the output cannot be written"
        _stop(prefix, f"{what} ({error.strerror or error})", code)
    else:
        if code:
            sys.exit(code)


def command_of(app: typer.Typer) -> Any:
    """The command of an application, with the option `--version`."""
    command, single = typer.main.get_command(app), application()
    single.command()(_only_version)
    command.params += typer.main.get_command(single).params
    return command


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"flightpower {version()}")
        raise typer.Exit


def _only_version(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version and exit.", callback=_print_version, is_eager=True, expose_value=False
        ),
    ] = False,
) -> None:
    """A command with the one option that every command gets."""


def takes_options(record: type[Record]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make each field of a command's record `options` an option of the command.

    record : a dataclass whose fields are annotated with `typer.Option` and have plain defaults
    """

    def decorated(command: Callable[..., Any]) -> Callable[..., Any]:
        annotations = get_type_hints(command, include_extras=True)
        of_record = get_type_hints(record, include_extras=True)
        names = {field.name for field in fields(record)}  # type: ignore[arg-type]
        keyword = inspect.Parameter.KEYWORD_ONLY
        parameters = []
        for parameter in inspect.signature(command).parameters.values():
            if parameter.name != "options":
                parameters.append(parameter.replace(kind=keyword, annotation=annotations[parameter.name]))
                continue
            for field in fields(record):  # type: ignore[arg-type]
                annotation = of_record[field.name]
                parameters.append(inspect.Parameter(field.name, keyword, default=field.default, annotation=annotation))

        def run_command(**keywords: Any) -> Any:
            options = record(**{name: keywords.pop(name) for name in names})
            return command(**keywords, options=options)

        return as_command(run_command, command, parameters)

    return decorated


def as_command(
    function: Callable[..., Any], command: Callable[..., Any], parameters: Sequence[inspect.Parameter]
) -> Callable[..., Any]:
    """Give `function` the name and help of `command`, and these parameters for Typer. It accepts keyword arguments."""
    function.__name__, function.__doc__ = command.__name__, command.__doc__
    function.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    function.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return function


def _check_encoding(arguments: list[str]) -> None:
    """Raises InputError for a word that cannot be written to a file because it is not in the system's encoding."""
    for word in arguments:
        try:
            word.encode()
        except UnicodeEncodeError:
            printable = word.encode("utf-8", "replace").decode()
            encoding = sys.getfilesystemencoding()
            raise InputError(
                f"{printable}: not in the system's encoding ({encoding}); rename it, or set LC_ALL=C.UTF-8"
            ) from None


def _stop(prefix: str, message: str, code: ExitCode = ExitCode.BAD_INPUT) -> None:
    print(f"{prefix}: {' '.join(message.splitlines())}", file=sys.stderr)
    sys.exit(code)


def _discard_output() -> None:
    """Redirect stdout to the null device, so that the interpreter does not try again to write to it when it ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _is_count(text: str) -> bool:
    return text.isdecimal() and int(text) > 0


def _usage(error: Any, name: str) -> str:
    """Describe the mistake in the arguments in one line. For a command without arguments, show its help and exit."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        sys.exit(ExitCode.BAD_INPUT)
    command = error.ctx.command_path if error.ctx else name
    message = " ".join(error.format_message().split())  # typer separates the listed choices by tabs
    return f"{message.rstrip('.')}; see `{command} --help`"


DECIMAL_COMMA = re.compile(r"-?\d+,\d+(?! *,)")


METAVARS = {
    "": "NUMBER", "%": "SHARE", "K": "TEMPERATURE", "Pa": "PRESSURE", "W": "POWER", "deg": "DIRECTION", "kg": "MASS",
    "kt": "SPEED", "m": "LENGTH", "m/s": "SPEED", "m^2": "AREA", "min": "TIME", "ohm": "RESISTANCE", "rpm": "RPM",
    "s": "TIME",
}  # fmt: skip


@dataclass(frozen=True)
class Quantity:
    """A quantity that an option takes: a plain number in `unit`, or one with a unit ("300 ft"), converted to `unit`.

    option, example : for messages; the example is in a unit other than `unit`
    least, most, above : limits in `unit`: least <= value <= most, value > above
    """

    option: str
    unit: str
    example: str
    _: KW_ONLY
    least: float = -math.inf
    most: float = math.inf
    above: float = -math.inf

    def as_option(self, help: str, metavar: str = "") -> Any:
        """The option of a command, for `Annotated`. metavar : by default derived from the unit."""
        return typer.Option(self.option, parser=self.parse, metavar=metavar or METAVARS[self.unit], help=help)

    def parse(self, text: str) -> float:
        """The value in `unit`. Raises InputError naming the option if it is no quantity or is outside the limits."""
        try:
            value = float(text)
        except ValueError:
            value = _si_or_nan(text, self.unit)
        if math.isfinite(value) and self.least <= value <= self.most and value > self.above:
            return value
        limits = (("above", self.above), ("at least", self.least), ("at most", self.most))
        within = " and ".join(f"{words} {limit:g}" for words, limit in limits if math.isfinite(limit))
        what = f"{within} {self.unit}".strip() if within else f"a quantity in {self.unit}"
        form = ": a plain number, or with a unit, such as" if self.unit else ", such as"
        point = f", and a decimal point: {text.replace(',', '.')}" if DECIMAL_COMMA.match(text) else ""
        raise InputError(f"{self.option} {text}: should be {what}{form} {self.example}{point}")


def numbers_and_unit(text: str, option: str, example: str) -> tuple[list[str], str]:
    """The numbers of a list, as typed, and the unit at its end ("100 200 - Pa"); ([], "") for an empty text.

    - stands for a number that was not read. Raises InputError naming the option if a word is no number, or the unit is
    missing.
    """
    *numbers, unit = text.replace(",", " ").split() or [""]
    wrong = [word for word in numbers if word != "-" and not math.isfinite(number_or_nan(word))]
    if wrong or (unit and not numbers) or math.isfinite(number_or_nan(unit)):
        what = f"{wrong[0]!r} is no number" if wrong else "numbers and their unit are needed"
        raise InputError(f"{option} {text!r}: {what}, such as {example}")
    return numbers, unit


def _si_or_nan(text: str, unit: str) -> float:
    try:
        if unit == "%":  # other dimensionless units, such as degrees, are not accepted
            return float(text.strip().removesuffix("%"))
        return to_si(text, unit, "")
    except (InputError, ValueError):
        return math.nan
