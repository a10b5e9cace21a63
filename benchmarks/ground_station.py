"""Tests MAVProxy as ground station for the daemon's telemetry: what it prints when it joins six seconds late.

    python3 -m venv /tmp/mavproxy && /tmp/mavproxy/bin/pip install MAVProxy      # a venv of its own
    python benchmarks/ground_station.py --mavproxy /tmp/mavproxy/bin/mavproxy.py

Fake parts and the daemon run in real time in this process, telemetry in its own, MAVProxy in a third. Exit code 1 if
MAVProxy does not see the aircraft and the state of the recording within five seconds of joining, or does not show a
long text in full.
"""

import re
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Annotated

import typer

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests" / "hw_fakes"))

LATE_S, LISTENED_S, KNOWN_WITHIN_S = 6.0, 12.0, 5.0
SEEN = {"the aircraft": "online system 25", "the state": "recording .* Hz"}
# The report of a disconnected static line, which is longer than the 50 bytes of one message.
LONG_TEXT = "barometers differ by .* is the static line off or blocked[?]"
TELEMETRY = '\n[telemetry]\nto = "udp:127.0.0.1:{port}"\n'


def record_flight(folder: Path, port: int, seconds: float) -> None:
    """Run the daemon on fake parts in real time."""
    from analytic_sensor_truth import AnalyticSensorTruth

    from flightpower.daq.clock import SystemClock
    from flightpower.daq.config import parse_tray
    from flightpower.daq.daemon import record
    from flightpower.daq.telemetry import TelemetryLink
    from flightpower.hw_fakes.tray import FakeTray

    class Truth(AnalyticSensorTruth):
        def absolute_pressure_Pa(self, which, t_s):  # type: ignore[no-untyped-def]
            return super().absolute_pressure_Pa(which, t_s) + 2000.0 * (which == "static")

    clock = SystemClock()
    head, *sensors = (ROOT / "daq" / "tray.example.toml").read_text("utf-8").split("\n[[sensors]]\n")
    alone = [sensor for sensor in sensors if 'driver = "autopilot"' not in sensor]
    text = "\n[[sensors]]\n".join([head + TELEMETRY.format(port=port), *alone])
    tray = parse_tray(text, "tray.toml", folder)
    assert tray.telemetry is not None
    link = TelemetryLink(tray.telemetry, tray)
    fake = FakeTray(Truth(), clock)
    record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + round(seconds * 1e9), listener=link)
    link.close()


def received_lines(mavproxy: str, folder: Path, port: int) -> list[tuple[float, str]]:
    """Return the lines that MAVProxy prints, with the time since its start [s]."""
    command = [mavproxy, f"--master=udpin:127.0.0.1:{port}", "--non-interactive", f"--state-basedir={folder}"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=folder)
    assert process.stdout is not None
    begin_s, lines = time.monotonic(), []
    threading.Timer(LISTENED_S, process.kill).start()
    for line in process.stdout:
        lines.append((time.monotonic() - begin_s, line.strip()))
    return lines


def main(
    mavproxy: Annotated[str, typer.Option(help="The program, of a venv of its own.")] = "mavproxy.py", port: int = 14650
) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        daemon = threading.Thread(target=record_flight, args=(folder, port, LATE_S + LISTENED_S + 2.0))
        daemon.start()
        time.sleep(LATE_S)
        lines = received_lines(mavproxy, folder, port)
        daemon.join()
    for at_s, line in lines:
        print(f"{at_s:6.2f}  {line}")
    joined_s = next((at_s for at_s, line in lines if re.search(SEEN["the aircraft"], line)), None)
    wrong = [] if joined_s is not None else ["the aircraft was not seen"]
    for what, pattern in SEEN.items():
        at_s = next((at_s for at_s, line in lines if re.search(pattern, line)), None)
        if at_s is not None and joined_s is not None:
            print(f"{what} is known {at_s - lines[0][0]:.1f} s after MAVProxy's first line")
        if at_s is None or at_s - lines[0][0] > KNOWN_WITHIN_S:
            wrong.append(f"{what}: not within {KNOWN_WITHIN_S:g} s")
    if not any(re.search(LONG_TEXT, line) for _, line in lines):
        wrong.append("the long text was not shown whole")
    print("; ".join(wrong) or "all as it should be")
    raise typer.Exit(bool(wrong))


if __name__ == "__main__":
    typer.run(main)
