"""Flies with one ordinary defect that no setting of the analysis covers, and gives the verdict on each flight.

    python benchmarks/unnamed.py --defects slipped-tray,weight-heavy --seed 0 --flights 1
    python benchmarks/unnamed.py --defects none --seed 7000 --flights 30

A defect is injected between the simulated flight and the log: it changes the aircraft that flies, a sensor's output, or
the data given to the analysis. The analysis has no setting for this defect. Flights are kept in `--file`, one per line.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import contextlib
import io
import json
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
import typer
from chain import compared, plan_text, read_truth
from estimators import speeds
from flights import fly_missing, tunnel_probe
from records import Record, counted, markdown, rounded

from flightpower.analysis.air.contents import Replacements
from flightpower.analysis.pipeline.runs import analyze_runs
from flightpower.analysis.records.flight import Trust
from flightpower.analysis.results.files import to_json
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log, read_log
from flightpower.flight.propeller import Propeller, Row
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.defects import Defects
from flightpower.sim.fly import fly
from flightpower.sim.output_folder import write_flight
from flightpower.sim.plan import load_plan
from flightpower.sim.plant import Deviations
from flightpower.sim.sensor_truth import GpsSolution
from flightpower.sim.sensors import FlightSensorTruth, draw
from flightpower.sim.sensors.tubing import first_order_lag
from flightpower.sim.world import load_world
from flightpower.simulate import _tray_variant, _write_without_hardware

AIRCRAFT, PLAN, WORLD = "nexstar", "two-pairs", "study"
FINE_S = 0.005  # grid on which a sensor's lag is computed


class Sensors:
    """Sensors of a flight; a defect overrides some of them."""

    def __init__(self, truth: FlightSensorTruth):
        self.truth, self.duration_s = truth, truth.duration_s

    def __getattr__(self, name: str) -> Any:
        return getattr(self.truth, name)

    @property
    def middle_s(self) -> float:
        return self.duration_s / 2

    def lagged(self, signal: Callable[[Array], Array], t_s: Array, time_constant_s: float) -> Array:
        """Return a quantity after a first-order lag."""
        grid = np.arange(0.0, self.duration_s + FINE_S, FINE_S)
        return np.interp(t_s, grid, first_order_lag(signal(grid), FINE_S, time_constant_s))


def turned(vectors: Array, axis: int, angle_rad: Array) -> Array:
    """Return components (n, 3) in axes that are turned by angles (n,) about one of the axes."""
    i, j = [k for k in range(3) if k != axis] if axis != 1 else [2, 0]
    out, c, s = vectors.copy(), np.cos(angle_rad), np.sin(angle_rad)
    out[:, i], out[:, j] = c * vectors[:, i] + s * vectors[:, j], c * vectors[:, j] - s * vectors[:, i]
    return out


class SmoothedMotorSpeed(Sensors):
    def motor_speed_revps(self, t_s: Array) -> Array:
        return self.lagged(self.truth.motor_speed_revps, t_s, 0.8)


class LateInertial(Sensors):
    late_s = 0.15

    def imu(self, t_s: Array) -> tuple[Array, Array]:
        return self.truth.imu(np.asarray(t_s) - self.late_s)


class LateAccelerometer(Sensors):
    def imu(self, t_s: Array) -> tuple[Array, Array]:
        return self.truth.imu(np.asarray(t_s) - 0.3)[0], self.truth.imu(t_s)[1]


class SlippedTray(Sensors):
    """The tray turns nose down by two degrees in mid-flight."""

    def imu(self, t_s: Array) -> tuple[Array, Array]:
        angle = np.radians(2.0) * (np.asarray(t_s) > self.middle_s)
        force, rate = self.truth.imu(t_s)
        return turned(force, 1, angle), turned(rate, 1, angle)


class LooseTray(Sensors):
    """The tray tilts with the specific force along the body, because its rubber mounts are too soft."""

    def imu(self, t_s: Array) -> tuple[Array, Array]:
        force, rate = self.truth.imu(t_s)
        angle = np.radians(6.0) * force[:, 0] / 9.81
        return turned(force, 1, angle), rate


class DriftingAccelerometer(Sensors):
    """The accelerometer's zero drifts by 0.4 m/s^2 over the flight."""

    def imu(self, t_s: Array) -> tuple[Array, Array]:
        force, rate = self.truth.imu(t_s)
        force = force.copy()
        force[:, 0] += 0.4 * np.clip(np.asarray(t_s) / self.duration_s, 0, 1)
        return force, rate


class GyroFeelsGravity(Sensors):
    def imu(self, t_s: Array) -> tuple[Array, Array]:
        force, rate = self.truth.imu(t_s)
        return force, rate + 0.003 * force[:, [2, 0, 1]]


class Pressures(Sensors):
    """Sensors whose differential pressures a defect alters in `changed`."""

    def changed(self, which: str, value: Array, t_s: Array) -> Array:
        return value

    def behind(self, which: str, t_s: Array, time_constant_s: float) -> Array:
        """Return the change of a pressure due to a lag of the line; the transducer's noise comes after the lag."""
        quiet = lambda t: self.truth._pneumatic(which, t)  # noqa: E731
        return self.lagged(quiet, t_s, time_constant_s) - quiet(t_s)

    def differential_pressure_Pa(self, which: str, t_s: Array) -> Array:
        return self.changed(which, self.truth.differential_pressure_Pa(which, t_s), np.asarray(t_s))


class BentProbe(Pressures):
    """The probe is bent down by two degrees in mid-flight, so that angle of attack reads too high."""

    def changed(self, which: str, value: Array, t_s: Array) -> Array:
        if which != "alpha":
            return value
        bent = np.radians(2.0) * (t_s > self.middle_s)
        return value + 4.5 * bent * self.truth.differential_pressure_Pa("airspeed", t_s)


class HalfBlockedTube(Pressures):
    def changed(self, which: str, value: Array, t_s: Array) -> Array:
        return value + self.behind(which, t_s, 0.8) if which == "airspeed" else value


class BlockedFlowAngle(Pressures):
    def changed(self, which: str, value: Array, t_s: Array) -> Array:
        return value + self.behind(which, t_s, 0.8) if which == "alpha" else value


class WaterInTheLine(Pressures):
    """A drop of water moves in a line, so that the airspeed zero wanders by some 12 Pa over the flight."""

    def changed(self, which: str, value: Array, t_s: Array) -> Array:
        aloft = (t_s > 0.15 * self.duration_s) & (t_s < 0.9 * self.duration_s)
        return value + (which == "airspeed") * aloft * 12 * np.sin(2 * np.pi * t_s / 70)


class CurvedTransducer(Pressures):
    """The airspeed transducer reads 6 % low at 300 Pa, and correctly at zero."""

    def changed(self, which: str, value: Array, t_s: Array) -> Array:
        return value * (1 - 0.06 * value / 300) if which == "airspeed" else value


class StickyTransducer(Pressures):
    """The airspeed transducer only follows changes of more than 12 Pa."""

    def differential_pressure_Pa(self, which: str, t_s: Array) -> Array:
        if which != "airspeed":
            return self.truth.differential_pressure_Pa(which, t_s)
        grid = np.arange(0.0, self.duration_s, 10 * FINE_S)
        quiet, stuck = self.truth._pneumatic(which, grid), []
        position = float(quiet[0])
        for x in quiet.tolist():
            position = min(max(position, x - 20), x + 20)
            stuck.append(position)
        return self.truth.differential_pressure_Pa(which, t_s) + np.interp(t_s, grid, np.array(stuck) - quiet)


class GpsJumps(Sensors):
    """The GPS velocity jumps by 2 m/s to one side for 6 s in every 25."""

    def gps(self, t_s: Array) -> GpsSolution:
        gps = self.truth.gps(t_s)
        aside = 2.0 * ((np.asarray(t_s) % 25) < 6)
        return gps._replace(velocity_ned_mps=gps.velocity_ned_mps + np.outer(aside, [1.0, -0.5, 0.0]))


class WanderingGpsClock(Sensors):
    """GPS solutions are up to a second late, by a varying amount."""

    def gps(self, t_s: Array) -> GpsSolution:
        late = 0.5 - 0.5 * np.cos(2 * np.pi * np.asarray(t_s) / 60)
        return self.truth.gps(np.asarray(t_s) - late)._replace(valid_at_s=self.truth.gps(t_s).valid_at_s)


class SlowStatic(Sensors):
    """Water in the static line delays its pressure by some seconds."""

    def absolute_pressure_Pa(self, which: str, t_s: Array) -> Array:
        value, quiet = self.truth.absolute_pressure_Pa(which, t_s), lambda t: self.truth._pneumatic(which, t)
        return value + self.lagged(quiet, t_s, 3.0) - quiet(t_s) if which == "static" else value


class WarmStart(Sensors):
    """The tray was in the sun, so its thermometer reads 12 K high at power-on."""

    def transducer_temperature_K(self, which: str, t_s: Array) -> Array:
        return self.truth.transducer_temperature_K(which, t_s) + 12.0


class LateGyro(Sensors):
    def imu(self, t_s: Array) -> tuple[Array, Array]:
        return self.truth.imu(t_s)[0], self.truth.imu(np.asarray(t_s) - 0.1)[1]


class UnevenAccelerometer(Sensors):
    """Positive accelerometer readings along the body are 6 % too large."""

    def imu(self, t_s: Array) -> tuple[Array, Array]:
        force, rate = self.truth.imu(t_s)
        force = force.copy()
        force[:, 0] *= np.where(force[:, 0] > 0, 1.06, 1.0)
        return force, rate


class ClippedTransducer(Pressures):
    """The airspeed transducer saturates at 220 Pa without reporting it."""

    def changed(self, which: str, value: Array, t_s: Array) -> Array:
        return np.minimum(value, 220.0) if which == "airspeed" else value


class CurrentInTransducer(Pressures):
    """Motor current moves the airspeed's zero by 12 Pa at 100 rev/s."""

    def changed(self, which: str, value: Array, t_s: Array) -> Array:
        return value + (which == "airspeed") * 12.0 * (self.truth.motor_speed_revps(t_s) / 100) ** 2


class Slipstream(Pressures):
    """The propeller's flow moves the pressure of the angle of attack by 8 Pa at 100 rev/s."""

    def changed(self, which: str, value: Array, t_s: Array) -> Array:
        return value + (which == "alpha") * 8.0 * (self.truth.motor_speed_revps(t_s) / 100) ** 2


class DriftingStatic(Sensors):
    """The static pressure falls by 1 Pa every second."""

    def absolute_pressure_Pa(self, which: str, t_s: Array) -> Array:
        return self.truth.absolute_pressure_Pa(which, t_s) - (which == "static") * 1.0 * np.asarray(t_s)


class HeldMotorSpeed(Sensors):
    """The motor-speed link repeats its last value for 1.5 s in every 5."""

    def motor_speed_revps(self, t_s: Array) -> Array:
        t = np.asarray(t_s)
        return self.truth.motor_speed_revps(np.where(t % 5 < 1.5, t - t % 5, t))


class DoublePulses(Sensors):
    """Noise adds pulses, so that motor speed reads 4 % high above 90 rev/s."""

    def motor_speed_revps(self, t_s: Array) -> Array:
        n = self.truth.motor_speed_revps(t_s)
        return np.where(n > 90.0, 1.04 * n, n)


def of_pitch(table: Propeller, factor: float) -> Propeller:
    """Return a table for another pitch: J is scaled by `factor`, cT and cP by its powers 1/2 and 3/2."""
    rows = tuple(
        Row(row.rpm, tuple(factor * J for J in row.J), tuple(factor**0.5 * c for c in row.cT),
            tuple(factor**1.5 * c for c in row.cP)) for row in table.rows
    )  # fmt: skip
    return Propeller(table.name, table.diameter_m, rows, table.source, table.beyond_zero_thrust)


def whole_pulses(log: Log) -> None:
    """Make the counter report only whole pulses, from seven pole pairs, that are completed in a tick of 0.04 s."""
    pulse, counted = 25 / 7, log.entries["/rpm"].columns["motor_speed_revps"].values
    for i, n in enumerate(counted):
        counted[i] = np.floor(n / pulse) * pulse


@dataclass(frozen=True)
class Defect:
    """title : one sentence     deviations : of the aircraft that flies     sensors : replace the flight's own
    installed : values of `sim.defects.Defects`
    propeller : that is flown, from the table that the analysis has     folds : its blades, beyond zero thrust
    recorded : changes the log in memory"""

    title: str
    deviations: Mapping[str, float] | None = None
    installed: Mapping[str, float] | None = None
    sensors: Callable[[FlightSensorTruth], Any] = Sensors
    propeller: Callable[[Propeller], Propeller] | None = None
    folds: bool = False
    recorded: Callable[[Log], None] | None = None


DEFECTS: Mapping[str, Defect] = {
    "none": Defect("none"),
    "weight-heavy": Defect("6 % heavier than the aircraft file says", {"weight_scale": 0.06}),
    "weight-light": Defect("6 % lighter than the aircraft file says", {"weight_scale": -0.06}),
    "whole-pulses": Defect("motor speed in whole pulses of a tick", recorded=whole_pulses),
    "smoothed-motor-speed": Defect("motor speed smoothed over 0.8 s", sensors=SmoothedMotorSpeed),
    "late-imu": Defect("all of the IMU 0.15 s late", sensors=LateInertial),
    "slipped-tray": Defect("the tray slips by 2 deg in mid-flight", sensors=SlippedTray),
    "bent-probe": Defect("the probe is bent by 2 deg in mid-flight", sensors=BentProbe),
    "half-blocked-tube": Defect("the airspeed's tube is half blocked: 0.8 s", sensors=HalfBlockedTube),
    "gps-jumps": Defect("GPS velocity jumps by 2 m/s for 6 s in every 25", sensors=GpsJumps),
    "other-pitch": Defect(
        "a propeller of 25 % more pitch than the table's", propeller=lambda propeller: of_pitch(propeller, 1.25)
    ),
    "folds": Defect("a propeller that folds beyond zero thrust, unsaid", folds=True),
    "nicked": Defect("a nicked propeller", {"thrust_scale": -0.10}),
    "late-accelerometer": Defect("accelerometers 0.3 s late, gyros not", sensors=LateAccelerometer),
    "loose-tray": Defect("the tray tilts 6 deg under 1 g along the body", sensors=LooseTray),
    "drifting-accelerometer": Defect("its zero drifts 0.4 m/s2 in the flight", sensors=DriftingAccelerometer),
    "gyro-feels-gravity": Defect("gyros read 1.7 deg/s under 1 g", sensors=GyroFeelsGravity),
    "blocked-flow-angle": Defect("the flow angle's tube is half blocked: 0.8 s", sensors=BlockedFlowAngle),
    "water-in-the-line": Defect("the airspeed's zero walks by 12 Pa", sensors=WaterInTheLine),
    "curved-transducer": Defect("airspeed pressure 6 % low at 300 Pa", sensors=CurvedTransducer),
    "sticky-transducer": Defect("airspeed pressure with a play of 40 Pa", sensors=StickyTransducer),
    "wandering-gps-clock": Defect("GPS between 0 and 1 s late", sensors=WanderingGpsClock),
    "slow-static": Defect("static pressure 3 s late", sensors=SlowStatic),
    "warm-start": Defect("12 K too warm at power-on", sensors=WarmStart),
    "unscaled-imu": Defect(
        "all of the IMU reads 2 % more", installed={"imu_gyro_scale": 0.02, "imu_accelerometer_scale": 0.02}
    ),
    "unscaled-gyro": Defect("gyros read 2 % more", installed={"imu_gyro_scale": 0.02}),
    "turned-imu": Defect(
        "IMU turned by 3 deg about each axis",
        installed=dict.fromkeys(("imu_roll_rad", "imu_pitch_rad", "imu_yaw_rad"), np.radians(3.0)),
    ),
    "bending-boom": Defect("the boom bends by 1 deg under 1 g", installed={"boom_bending_rad": np.radians(1.0)}),
    # These defects were not looked at before the study.
    "late-gyro": Defect("gyros 0.1 s late, accelerometers not", sensors=LateGyro),
    "uneven-accelerometer": Defect("6 % more of a positive force along the body", sensors=UnevenAccelerometer),
    "clipped-transducer": Defect("airspeed pressure ends at 220 Pa", sensors=ClippedTransducer),
    "current-in-transducer": Defect("airspeed's zero moves 12 Pa at 100 rev/s", sensors=CurrentInTransducer),
    "slipstream": Defect("flow angle's zero moves 8 Pa at 100 rev/s", sensors=Slipstream),
    "drifting-static": Defect("static pressure falls 1 Pa every second", sensors=DriftingStatic),
    "held-motor-speed": Defect("motor speed held for 1.5 s in every 5", sensors=HeldMotorSpeed),
    "double-pulses": Defect("4 % more pulses above 90 rev/s", sensors=DoublePulses),
    "weak-propeller": Defect("thrust 15 % less, with less slope", {"thrust_scale": -0.15, "thrust_slope_J": -0.3}),
}


class Job(NamedTuple):
    """One flight to fly and to analyze."""

    defect: str
    weather_kt: float
    seed: int
    version: str
    probe: str


def flown(job: Job, folder: Path) -> Path:
    """Fly and record into a folder. Returns the log."""
    defect, world = DEFECTS[job.defect], load_world(WORLD)
    world = replace(world, errors=replace(world.errors, defects=Defects(**(defect.installed or {}))))
    (folder / "plan.toml").write_text(plan_text(PLAN, job.weather_kt), "utf-8")
    craft, plan = load_complete_aircraft(AIRCRAFT), load_plan(str(folder / "plan.toml"))
    errors = draw(world.errors, job.seed)
    deviations: Deviations = errors.deviations
    for name, more in (defect.deviations or {}).items():
        deviations = replace(deviations, **{name: getattr(deviations, name) + more})
    as_flown = craft
    if defect.propeller:
        (folder / "flown.csv").write_text(defect.propeller(load_propeller(craft.propulsion.propeller)).to_csv())
        as_flown = replace(craft, propulsion=replace(craft.propulsion, propeller=str(folder / "flown.csv")))
    if defect.folds:
        as_flown = replace(craft, propulsion=replace(craft.propulsion, beyond_zero_thrust="fold"))
    flight = fly(as_flown, world.plan(plan, job.seed), seed=job.seed, deviations=deviations)
    write_flight(folder, replace(flight, aircraft=craft), errors, world, aircraft=AIRCRAFT, calibration=job.probe)
    _write_without_hardware(
        folder, defect.sensors(FlightSensorTruth(flight, errors)), job.seed,
        _tray_variant(craft, None, plan.air.time_of_day_s), craft, report=lambda _: None,
    )  # fmt: skip
    return folder / "log.mcap"


def as_recorded(defect: str, path: Path) -> Log:
    """Return the log of a flight with the recorder's defect."""
    log, wrong = read_log(path), DEFECTS[defect].recorded
    if wrong is not None:
        wrong(log)
    return log


def one_flight(job: Job) -> dict[str, Any]:
    """Return error and half the 95 % interval at each speed, % of the truth, verdict and evidence."""
    line: dict[str, Any] = {
        "defect": job.defect,
        "weather_kt": job.weather_kt,
        "seed": job.seed,
        "version": job.version,
    }
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stderr(io.StringIO()):
        folder = Path(name)
        try:
            analysis = analyze_runs(as_recorded(job.defect, flown(job, folder)), Replacements())
        except (InputError, np.linalg.LinAlgError) as error:
            return {**line, "refused": str(error).replace(name, "")}
        V, results = speeds(load_aircraft(AIRCRAFT)), json.loads(to_json(analysis.results))
        error, half = (
            [float(x) if np.isfinite(x) else None for x in row] for row in compared(results, read_truth(folder), V)
        )
    evidence = analysis.results.evidence
    return {
        **line, "error": error, "half": half, "trust": analysis.results.trust,
        "evidence": [[e.kind, e.subject, e.figure, e.limit, e.level] for e in evidence],
    }  # fmt: skip


def worst(line: Mapping[str, Any]) -> float:
    """Return the largest error, in half widths of the interval."""
    return max(abs(e) / h for e, h in zip(line["error"], line["half"], strict=True) if e is not None)


def summary(line: Mapping[str, Any]) -> str:
    """Return a line on one flight."""
    head = f"{line['defect']}, {line['weather_kt']:g} kt, seed {line['seed']}"
    if "error" not in line:
        return f"{head}: refused, {line['refused']}"
    points = zip(line["error"], line["half"], strict=True)
    errors_text = ", ".join(f"{e:+.1f}±{h:.1f}" for e, h in points if e is not None)
    warnings = "; ".join(
        f"{kind} {subject} {figure or 0:+.2g} ({limit or 0:.2g})"
        for kind, subject, figure, limit, _ in line["evidence"]
    )
    return f"{head}: {errors_text} %, {worst(line):.1f} half widths, {line['trust']}. {warnings}"


def records(lines: Sequence[Mapping[str, Any]]) -> list[Record]:
    """Return a row per defect: errors of the curves in half widths, and the verdicts on them."""
    records: list[Record] = []
    for name in dict.fromkeys(line["defect"] for line in lines):
        some = [line for line in lines if line["defect"] == name]
        done = [line for line in some if "error" in line]
        record: Record = {"defect": name, "flights": len(some)}
        record["error, half widths"] = " / ".join(f"{worst(line):.1f}" for line in done)
        record["verdicts"] = [sum(line["trust"] == level for line in done) for level in Trust]
        kinds = dict.fromkeys(evidence[0] for line in done for evidence in line["evidence"])
        records.append(record | {"evidence": ", ".join(kinds) or None})
    return records


def judged(lines: Sequence[Mapping[str, Any]]) -> list[Record]:
    """Return the verdicts on curves, grouped by how wrong the curves are."""
    records: list[Record] = []
    bounds = ((0.0, 1.0, "right"), (1.0, 1.5, "wrong by 1.0 to 1.5 half widths"), (1.5, 3.0, "by 1.5 to 3"),
              (3.0, np.inf, "by more"))  # fmt: skip
    for low, high, title in bounds:
        some = [line for line in lines if "error" in line and low <= worst(line) < high]
        records.append({"curve": title, "flights": len(some), **verdicts(some)})
    return records


def verdicts(lines: Sequence[Mapping[str, Any]]) -> Record:
    """Return counts of the verdicts, and the share that is not trusted [%] with its counting error."""
    of_level = {level.value: sum(line["trust"] == level for line in lines) for level in Trust}
    if not lines:
        return of_level | {"not trusted, %": None, "±": None}
    share, counting = counted([line["trust"] != Trust.TRUSTED for line in lines])
    return of_level | {"not trusted, %": rounded(share), "±": rounded(counting)}


def jobs_of(
    names: Sequence[str], weather_kt: Sequence[float], flights: int, first_seed: int, version: str
) -> Iterator[Job]:
    probe = msgspec.json.encode(tunnel_probe()).decode()
    for i in range(flights):
        for name in names:
            for kt in weather_kt:
                yield Job(name, kt, first_seed + i, version, probe)


def key(line: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(line[name] for name in ("defect", "weather_kt", "seed", "version"))


def flown_lines(names: Sequence[str], weather_kt: Sequence[float], flights: int, seed: int, file: Path, jobs: int,
         label: str = "") -> list[dict[str, Any]]:  # fmt: skip
    """Return the lines of all flights; flights that the file lacks, or has with another label, are flown."""
    todo = {job[:4]: job for job in jobs_of(names, weather_kt, flights, seed, label)}
    done = fly_missing(file, todo, one_flight, key, jobs=jobs, summary=summary)
    return [done[identity] for identity in todo]


def named() -> list[str]:
    """Return all defects by name."""
    return [name for name in DEFECTS if name != "none"]


def main(
    defects: Annotated[str, typer.Option(help="Names of DEFECTS, with commas; all but none.")] = "",
    weather: Annotated[str, typer.Option(help="W20 of turbulence [kt].")] = "0,3",
    flights: Annotated[int, typer.Option(help="Of each defect and weather.")] = 1,
    seed: Annotated[int, typer.Option(help="The first; development uses those below 1000.")] = 0,
    label: Annotated[str, typer.Option(help="Flights of another label are flown again.")] = "",
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
    file: Annotated[Path, typer.Option(help="Where flights are kept, one a line.")] = Path("out/unnamed.jsonl"),
) -> None:
    """Fly what is missing and print the tables."""
    names = defects.split(",") if defects else named()
    lines = flown_lines(names, [float(kt) for kt in weather.split(",")], flights, seed, file, jobs, label)
    print(f"\n{markdown(records(lines))}\n\n{markdown(judged(lines))}")


if __name__ == "__main__":
    typer.run(main)
