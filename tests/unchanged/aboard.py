"""What the daemon's parts compute from readings of simulated flights: verdicts on runs, telemetry, zeros, checks."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.daq import rest_check
from flightpower.daq.config import TelemetryConfig
from flightpower.daq.run_monitor import RunMonitor
from flightpower.daq.sensors import Sample
from flightpower.daq.still_air_zero import zero_from_samples
from flightpower.daq.telemetry import MavlinkEncoder, Snapshot
from flightpower.daq.thrust import load_thrust
from flightpower.daq.tick_means import TickMeans
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.log_reader import Log, read_log
from flightpower.flight.messages import Event
from flightpower.flight.probe_maps import ProbeMaps
from tests.unchanged import commands

TICK_NS = 40_000_000
Contents = dict[str, object]


@cache
def log_of(flight: Callable[[], bytes]) -> Log:
    with commands.new_folder() as folder:
        (folder / "log.mcap").write_bytes(flight())
        return read_log(folder / "log.mcap")


def ticks_of(log: Log) -> Iterator[tuple[int, list[Sample]]]:
    ticks: dict[int, list[Sample]] = defaultdict(list)
    for topic, entries in log.entries.items():
        for entry in entries:
            ticks[entry.tick].append(Sample(topic, entry.time_ns, entry.message))
    yield from sorted(ticks.items())


def probe_of(log: Log) -> ProbeMaps:
    return msgspec.json.decode(log.attachments["probe.json"], type=ProbeMaps)


def monitored(log: Log, aircraft: Aircraft, probe: ProbeMaps | None, speed: float = 1.0) -> Contents:
    """Motion, verdicts and the interval so far; `speed` is a factor on airspeed, applied to the dynamic pressure."""
    monitor, means = RunMonitor(aircraft, probe), TickMeans()
    motion = RunMonitor(aircraft, probe).motion
    moved, verdicts = [], []
    for tick, samples in ticks_of(log):
        finished = means.add(tick * TICK_NS, samples)
        if finished is None:
            continue
        if speed != 1.0 and finished.q_c_Pa is not None:
            finished = msgspec.structs.replace(finished, q_c_Pa=finished.q_c_Pa * speed**2)
        motion_now = motion.at(finished)
        if motion_now is not None:
            moved.append(motion_now._replace(drag=motion_now.drag or (np.nan,) * 4))
        verdicts += monitor.add(finished)
    speeds = np.linspace(10.0, 24.0, 8)
    fields = ("t_s", "V", "height_m", "bank", "complete")
    return {
        "motion": {name: [getattr(item, name) for item in moved] for name in fields},
        "drag": np.array([item.drag for item in moved]).T.tolist(),
        "verdicts": [
            {name: getattr(verdict, name) for name in ("kind", "start_s", "end_s", "reason", "text")}
            for verdict in verdicts
        ],
        "runs": [monitor.runs, monitor.slowest_mps, monitor.fastest_mps],
        "polar": monitor.energy.polar(),
        "power_W": [monitor.energy.power_W(V, aircraft.mass_kg) for V in speeds.tolist()],
        "interval": [monitor.energy.at_endurance_speed(V, V + 6) for V in (10.0, 16.0)],
    }


def run_monitor() -> Contents:
    demo, maneuvers = log_of(commands.demo_log), log_of(commands.maneuvers_log)
    nexstar = load_aircraft("nexstar")
    changed = replace(nexstar.propulsion, beyond_zero_thrust="fold", static_thrust_ratio=1.03)
    stand = replace(nexstar, propulsion=changed)
    return {
        "demonstration": monitored(demo, nexstar, probe_of(demo)),
        "maneuvers": monitored(maneuvers, nexstar, probe_of(maneuvers)),
        "of a stand": monitored(demo, stand, None),
        "other speeds": [monitored(demo, nexstar, probe_of(demo), speed)["verdicts"] for speed in (0.8, 1.3)],
    }


def telemetry() -> Contents:
    """Every field of the packets of a flight, each second."""
    log = log_of(commands.demo_log)
    zero = zero_from_samples(
        (sample for tick, samples in ticks_of(log) if 100 < tick < 400 for sample in samples),
        ticks=299, seconds=12.0, unix_ns=0,
    )  # fmt: skip
    contents: Contents = {"zero": zero}
    for name, config, probe, system_id in (
        ("alone", TelemetryConfig(to="udp:127.0.0.1:14550"), probe_of(log), zero),
        ("with an autopilot", TelemetryConfig(to="udp:127.0.0.1:14550", vehicle=False), None, None),
    ):
        encoder, parser = MavlinkEncoder(config, probe, system_id), mavlink.MAVLink(None)
        sent: dict[str, list[dict[str, object]]] = defaultdict(list)
        latest: dict[str, Sample] = {}
        for tick, samples in ticks_of(log):
            latest |= {sample.topic: sample for sample in samples}
            if tick % 20:
                continue
            snapshot = Snapshot(
                elapsed_s=tick * TICK_NS / 1e9,
                messages={topic: msgspec.to_builtins(sample.message) for topic, sample in latest.items()},
                ages_s={topic: 0.1 for topic in latest},
                events=[Event(severity="warning", text=f"tick {tick}")] if tick % 500 == 0 else [],
            )
            for packet in encoder.packets(snapshot):
                for message in parser.parse_buffer(packet) or ():
                    fields = message.to_dict()
                    sent[f"{fields.pop('mavpackettype')} {fields.pop('name', '')}"].append(fields)
        contents[name] = sent
    return contents


def thrust() -> Contents:
    """Thrust of the shipped propellers, over speed and motor speed."""
    names = ("apc-10x5e", "apc-12x8e", "apc-12x8e-windmilling", "blade-11x5", "blade-16x10")
    tables = {f"{name} {folding}": load_thrust(name, folding=folding) for name in names for folding in (False, True)}
    return {
        name: [[table.thrust_N(V, n, 1.1) for V in (0.0, 5.0, 11.0, 18.0, 30.0)] for n in (20.0, 70.0, 110.0, 200.0)]
        for name, table in tables.items()
        if table is not None
    }


def rest() -> Contents:
    """Readings on the ground and in the air, taken for those of an aircraft at rest."""
    log = log_of(commands.demo_log)
    contents: Contents = {"height": [rest_check.standard_height_m(p) for p in (70e3, 95e3, 104e3)]}
    for name, first in (("on the ground", 100), ("in the air", 1500)):
        messages = {
            topic: [entry.message for entry in entries if first <= entry.tick < first + 100]
            for topic, entries in log.entries.items()
        }
        contents[name] = {topic: rest_check.rest_problem(of_topic) for topic, of_topic in messages.items()}
        contents[f"{name}, height"] = rest_check.height_comparison(messages)
        contents[f"{name}, barometers"] = rest_check.barometer_comparison(messages)
    return contents


CASES = {"run-monitor": run_monitor, "telemetry": telemetry, "thrust": thrust, "at-rest": rest}
