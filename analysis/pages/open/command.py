"""The command `flightpower open`: arguments and messages."""

import os
import secrets
import signal
import socket
import sys
import tempfile
import webbrowser
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer

from flightpower.analysis.beside import beside
from flightpower.flight.command_line import application, run
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log

app = application(no_args_is_help=False)


@app.command(name="open")
def open_page(
    logs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[LOG]", help="A log, or several in one folder, or a folder; default: this folder."),
    ] = None,
    port: Annotated[
        int, typer.Option("--port", metavar="PORT", min=0, max=65535, help="Port of the page; default: any free one.")
    ] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser, or only print its address.")
    ] = True,
) -> None:
    """View flights and edit their runs in the browser: time histories, modes, track, and the resulting curve.

    Open any log or table that `analyze` reads, or drop it on the page. Ends of runs, or of stretches to leave
    out, are dragged, or typed; values of aircraft and propeller are changed. The curve follows at once. "Write the
    report" writes what `analyze` writes, and the page shows the command that gives the same. The page is for this
    computer only, and closes with the terminal (Ctrl-C).

    \b
    Examples:
      flightpower open                  the logs of this folder
      flightpower open flights/today/log.ulg
    """
    folder, first = opened_folder(logs or [])
    for closing in ("SIGTERM", "SIGHUP"):  # SIGHUP comes when the terminal closes, not on Windows
        if hasattr(signal, closing):
            signal.signal(getattr(signal, closing), lambda *_: sys.exit(0))
    with _listening(port) as server_socket, tempfile.TemporaryDirectory(prefix="flightpower-") as workspace:
        token = secrets.token_urlsafe(24)
        address = f"http://127.0.0.1:{server_socket.getsockname()[1]}/{token}/" + (f"#{quote(first)}" if first else "")
        # Reading and importing each take most of a second.
        reading = beside(lambda: read_log(folder / first)) if first.endswith(".mcap") else None
        print(f"{address}\nThe page of {folder.resolve()} is open until Ctrl-C.", flush=True)
        if browser:
            webbrowser.open(address)
        # For these small matrices, a pool of threads takes several times the processor time.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        from flightpower.analysis.pages.lean_imports import import_lean  # loads NumPy, limited to one thread

        import_lean()
        from flightpower.analysis.pages.open.flights import Folder  # meanwhile the browser starts
        from flightpower.analysis.pages.open.server import serve

        opened = Folder(folder, Path(workspace), {first: reading} if reading else {})
        names = [first] if first else list(opened.logs())
        serve(opened, server_socket, token, names[0] if len(names) == 1 else "")


def _listening(port: int) -> socket.socket:
    """Return a socket for this computer only. Raises InputError if the port is in use."""
    try:
        return socket.create_server(("127.0.0.1", port))
    except OSError as error:
        raise InputError(f"port {port}: is not available ({error.strerror or error}); give another --port") from None


def opened_folder(logs: list[Path]) -> tuple[Path, str]:
    """Return the folder of the logs, and the name of the first. Raises InputError for a log that is missing or in
    another folder, and for a file that is not a log.
    """
    from flightpower.analysis.sources.open import refuse_non_log

    for path in logs:
        if not path.exists():
            raise InputError(f"{path}: there is no such log or folder")
        if path.is_file():
            refuse_non_log(path)
    if not logs:
        return Path(), ""
    folders = {path if path.is_dir() else path.parent for path in logs}
    if len({folder.resolve() for folder in folders}) > 1:
        raise InputError(f"{logs[0]}, {logs[-1]}: are in several folders; open one folder")
    first = next((path.name for path in logs if path.is_file()), "")
    return folders.pop(), first


def main() -> None:
    run(app, "flightpower open")


if __name__ == "__main__":
    main()
