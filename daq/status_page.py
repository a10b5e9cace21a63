"""Makes a page for the phone at the airfield, which shows whether the daemon is alive, the state of the sensors, and
the logs.

A WSGI application (PEP 3333) that only reads: the status file of the daemon, the folder of the logs, and the results of
the last `daq zero` and `daq check`. It runs in its own process.
"""

import socket
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from flightpower.daq.computer_watch import CELSIUS_K
from flightpower.daq.config import Tray
from flightpower.daq.log_names import numbered_logs
from flightpower.daq.plausibility import Values
from flightpower.daq.recording_status import IN_ORDER, NO_NEWS_S, PublishedStatus, RecordingState
from flightpower.daq.still_air_zero import Zero
from flightpower.daq.tray_check import check_file
from flightpower.flight.errors import InputError

SHOWN_LOGS = 5
REFRESH_S = 2
# Many idle connections, such as a phone leaves when it goes out of range, must not shut anybody out.
SERVER: dict[str, Any] = {
    "threads": 2,
    "ident": "",
    "connection_limit": 500,
    "channel_timeout": 10,  # seconds until an idle connection is closed
    "cleanup_interval": 5,
    "asyncore_use_poll": True,  # select() accepts at most 1,024 files
}
HEADERS = [
    ("Content-Type", "text/html; charset=utf-8"),
    ("Content-Security-Policy", "default-src 'none'; style-src 'unsafe-inline'"),
    ("X-Content-Type-Options", "nosniff"),
    ("Cache-Control", "no-store"),
]
STYLE = """
:root { color-scheme: light dark }
body { font: 18px/1.4 sans-serif; margin: 0; color: #000; background: #fff }
h1 { margin: 0; padding: .6em; font-size: 1.3em; color: #fff }
h1.good { background: #00592b } h1.bad { background: #a00000 }
h2 { font-size: 1em; margin: 1.2em 0 .2em }
main { padding: 0 .8em 2em; max-width: 45em }
table { border-collapse: collapse; width: 100% }
td { padding: .2em .6em .2em 0; border-bottom: 1px solid #ccc; vertical-align: top; overflow-wrap: anywhere }
td:first-child { overflow-wrap: normal; width: 8em }
td.bad { color: #a00000; font-weight: bold }
section.stale td, section.stale h2 { color: #767676; font-weight: normal }
@media (prefers-color-scheme: dark) {
  body { color: #eee; background: #121212 }
  td { border-color: #444 }
  td.bad { color: #ff8a80 }
  section.stale td, section.stale h2 { color: #8a8a8a }
}
"""

StartResponse = Callable[[str, list[tuple[str, str]]], Any]
Application = Callable[[dict[str, Any], StartResponse], Iterable[bytes]]


class Sources(NamedTuple):
    """The files that the page shows."""

    status: Path
    logs: Path
    zero: Path
    check: Path


def sources_of(tray: Tray, status: Path) -> Sources:
    return Sources(status, Path(tray.directory), Path(tray.zero), check_file(tray))


def application(sources: Sources) -> Application:
    """A WSGI application that answers GET and HEAD of / with the page, and anything else with an error."""

    def answer(environ: dict[str, Any], start_response: StartResponse) -> Iterable[bytes]:
        if environ["REQUEST_METHOD"] not in ("GET", "HEAD"):
            start_response("405 Method Not Allowed", [*HEADERS, ("Allow", "GET, HEAD")])
            return [b""]
        if environ.get("PATH_INFO", "/") not in ("", "/"):
            start_response("404 Not Found", HEADERS)
            return [b""]
        start_response("200 OK", HEADERS)
        return [page(sources, time.time()).encode()]

    return answer


def page(sources: Sources, now_s: float) -> str:
    """The HTML page. now_s: Unix time of the system clock, for the age of the status file."""
    headline, good, parts = _daemon(sources.status, now_s)
    parts.append(_section("Logs", _logs(sources.logs)))
    parts.append(_section("On the ground", [_zero(sources.zero), _check(sources.check)]))
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="{REFRESH_S}">'
        f'<meta name="viewport" content="width=device-width"><title>{escape(headline)}</title><style>{STYLE}</style>'
        f'</head><body><h1 class="{"good" if good else "bad"}">{escape(headline)}</h1><main>{"".join(parts)}</main>'
        "</body></html>"
    )


Row = tuple[str, str, bool]  # name, value, whether the value is in order


def _daemon(path: Path, now_s: float) -> tuple[str, bool, list[str]]:
    """Headline, whether all is well, and the sections about the daemon."""
    try:
        age_s = now_s - path.stat().st_mtime
        published = msgspec.json.decode(path.read_bytes(), type=PublishedStatus)
    except (OSError, msgspec.MsgspecError):
        return "The daemon does not run", False, []
    status = msgspec.structs.replace(published.status, age_s=max(0.0, age_s))
    silent = status.age_s > NO_NEWS_S
    recording = status.state is RecordingState.RECORDING
    rows: list[Row] = [
        ("log", status.log or "none", bool(status.log) or not recording),
        ("ticks", f"{status.ticks}, {status.missed} missed", not status.late),
    ]
    if status.free_bytes is not None:
        rows.append(("free on the card", f"{status.free_bytes / 1e9:.1f} GB", True))
    rows += [("card", status.error, False)] if status.error else []
    rows += [("bus", text, False) for text in status.slow]
    rows += [("readings", text, False) for text in status.implausible]
    rows += [("trouble", text, False) for text in status.trouble]
    if status.processor_temperature_K is not None:
        rows.append(("processor", f"{status.processor_temperature_K - CELSIUS_K:.0f} °C", True))
    rows += [("run", status.run, True)] if status.run else []
    rows += [("reached", status.reached, True)] if status.reached else []
    rows += [("card", line, True) for line in status.card]
    rows += _values(status.values)
    sensors: list[Row] = [(name, state, state in IN_ORDER) for name, state in status.sensors.items()]
    events: list[Row] = [
        (f"{_time(item.unix_s)} {item.event.severity}", item.event.text, item.event.severity == "info")
        for item in published.events
    ]
    since = _time(now_s - age_s)
    tables = _section(f"Last at {since}" if silent else "Now", rows) + _section("Sensors", sensors)
    headline = f"No answer since {since} UTC: the daemon hangs or does not run" if silent else status.summary
    return (
        headline,
        status.well,
        [f'<section class="stale">{tables}</section>' if silent else tables, _section("Latest events, UTC", events)],
    )


def _values(values: Values) -> list[Row]:
    """The latest readings, without missing values."""
    lines = (
        ("airspeed", values.airspeed_mps, "{:.1f} m/s"),
        ("height", values.height_msl_m, "{:.0f} m above sea level"),
        ("satellites", values.satellites, "{}"),
        ("motor", None if values.motor_speed_revps is None else 60 * values.motor_speed_revps, "{:.0f} rpm"),
    )
    return [(name, text.format(value), True) for name, value, text in lines if value is not None]


def _logs(directory: Path) -> list[Row]:
    rows: list[Row] = []
    for path in reversed(numbered_logs(directory)[-SHOWN_LOGS:]):
        try:
            rows.append((path.name, f"{path.stat().st_size / 1e6:.1f} MB", True))
        except OSError:
            continue
    return rows or [("none", f"named log-NNNN.mcap in {directory}", True)]


def _zero(path: Path) -> Row:
    try:
        zero = msgspec.json.decode(path.read_bytes(), type=Zero)
    except (OSError, msgspec.MsgspecError):
        return "still-air zero", "not taken (`daq zero`)", False
    return "still-air zero", f"taken {_utc(zero.taken_unix_ns / 1e9)}", True


def _check(path: Path) -> Row:
    try:
        content = msgspec.json.decode(path.read_bytes(), type=dict[str, Any])
        when = _utc(path.stat().st_mtime)
    except (OSError, msgspec.MsgspecError):
        return "check", "not made (`daq check`)", False
    fit = content.get("fit") is True
    bad = [str(line.get("topic")) for line in content.get("lines", []) if line.get("ok") is False]
    bad += [str(fact.get("text")) for fact in content.get("facts", []) if fact.get("ok") is False]
    return "check", f"{'fit to fly' if fit else 'not fit to fly: ' + ', '.join(bad)} ({when})", fit


def _time(unix_s: float) -> str:
    return f"{datetime.fromtimestamp(unix_s, UTC):%H:%M:%S}"


def _utc(unix_s: float) -> str:
    return f"{datetime.fromtimestamp(unix_s, UTC):%Y-%m-%d %H:%M} UTC by the Pi's clock"


def _section(title: str, rows: list[Row]) -> str:
    cells = "".join(
        f'<tr><td>{escape(name)}</td><td class="{"good" if good else "bad"}">{escape(value)}</td></tr>'
        for name, value, good in rows
    )
    return f"<h2>{escape(title)}</h2><table>{cells}</table>" if rows else ""


def serve(sources: Sources, host: str, port: int, *, show: Callable[[str], None]) -> None:
    """Serve the page until the process ends. show : receives the address, in lines for the user

    Raises InputError if the server is not installed, or the address is not free.
    """
    try:
        import waitress  # type: ignore[import-untyped]
    except ImportError:
        raise InputError("the status page needs a web server: pip install 'flightpower[status]'") from None
    try:
        server = waitress.create_server(application(sources), host=host, port=port, **SERVER)
    except (OSError, ValueError) as error:  # ValueError: a name that has no address
        cause = error.strerror if isinstance(error, OSError) else None
        raise InputError(f"{host}:{port}: is not available ({cause or error})") from None
    show(f"http://{_reachable(host)}:{port}/\nThe status page is served until Ctrl-C.")
    server.run()


def _reachable(host: str) -> str:
    """The host by which a browser reaches the page; if it listens on all networks, the outward interface's address."""
    if host not in ("0.0.0.0", "::", "[::]"):
        return f"[{host}]" if ":" in host and not host.startswith("[") else host
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outward, suppress(OSError):
        outward.connect(("192.0.2.1", 9))  # nobody's address (RFC 5737); connecting sends nothing
        return str(outward.getsockname()[0])
    return socket.gethostname()
