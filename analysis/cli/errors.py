"""One clear line for an error, and its exit code."""

import sys

import typer

from flight.errors import InputError


def run(app: typer.Typer) -> None:
    """Run a command; print an InputError as one line on stderr and exit with code 2."""
    try:
        app(standalone_mode=True)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:
        sys.exit(1)
