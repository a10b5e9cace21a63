"""Errors of the commands: one line on stderr, and the exit code."""

import sys

import typer

from flight.errors import InputError


def run(app: typer.Typer) -> None:
    """Run a command. An InputError is printed as one line on stderr, with exit code 2; a closed pipe exits with 1."""
    try:
        app(standalone_mode=True)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:
        sys.exit(1)
