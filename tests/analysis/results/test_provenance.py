"""Tests the record of what results were made from, and the note if they replace results with other options."""

import hashlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.air.contents import Replacements
from flightpower.analysis.flight import Recorded
from flightpower.analysis.records.flight import AircraftResult, ConditionResult, CurveResult, Kind, Provenance, Results
from flightpower.analysis.results.files import to_json
from flightpower.analysis.results.flight_found import autocorrelation, parameter_correlation, track
from flightpower.analysis.results.previous import replaced
from flightpower.analysis.results.provenance import provenance, provenance_of_file
from flightpower.analysis.sources.daemon import first_ns, fix_of_log
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.analysis.sources.structure import receiver_notes
from flightpower.flight.log_entries import LogEntry, entries_of
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import Comparison, Event, Gps, Imu, Status, Tick
from flightpower.sim.ulog_writer import UlogContents, UlogTopic, write_ulog

START_NS = 5_000_000_000


def contents(propeller: str | None = None) -> SimpleNamespace:
    return SimpleNamespace(
        aircraft=SimpleNamespace(name="mine", propulsion=SimpleNamespace(propeller=propeller)),
        propeller=SimpleNamespace(name=propeller or "table"), probe=SimpleNamespace(source="tunnel.csv"),
        thrust_stand=None, airspeed=None, magnetometer=None, transducers=None, zero=None,
    )  # fmt: skip


@pytest.fixture
def log(tmp_path: Path) -> Log:
    path = tmp_path / "log.mcap"
    path.write_bytes(b"recorded")

    def entry(seconds: float, message: object) -> LogEntry:
        return LogEntry(START_NS + round(seconds * 1e9), 0, message)

    imu = [
        entry(0, Imu(status=Status.STARTING)),
        entry(1, Imu()),
        entry(2, Imu(status=Status.CORRUPT)),
        entry(60, Imu()),
    ]
    gps = [entry(1, Gps(status=Status.STARTING)), entry(10, Gps(utc_ns=1_463_218_200_000_000_000, latitude_deg=-35.5,
                                                         longitude_deg=78.25, height_msl_m=100.0))]  # fmt: skip
    return Log(
        path,
        {"/imu": entries_of(imu), "/gps": entries_of(gps),
         "/daq/tick": entries_of([entry(0, Tick()), entry(1, Tick(missed=3))]),
         "/daq/event": entries_of(
             [entry(0, Event(text="starts")), entry(30, Event(severity="error", sensor="gps", text="gps lost"))])},
        attachments={name: name.encode() for name in ("aircraft.toml", "propeller.csv", "probe.json")},
        metadata={"flightpower": {"version": "0.1.0"}},
    )  # fmt: skip


def made(
    log: Log, command: str = "analyze log.mcap", replacements: Replacements = Replacements(), **held
) -> Provenance:
    fix = fix_of_log(log, first_ns(log))
    return provenance(Recorded(log=log, replacements=replacements, contents=contents(**held), fix=fix), None, command)


def test_date_place_and_health_are_those_of_the_log(log: Log) -> None:
    result = made(log)
    assert (result.start_utc, result.clock) == ("2016-05-14T09:29:50Z", "satellites"), "starts 10 s before the fix"
    assert (result.latitude_deg, result.longitude_deg, result.height_msl_m) == (-35.5, 78.25, 100.0)
    assert (result.ticks, result.ticks_missed, result.duration_s) == (2, 3, 60.0)
    imu = next(sensor for sensor in result.sensors if sensor.topic == "/imu")
    assert (imu.messages, imu.measurements, imu.faults) == (3, 2, {"corrupt": 1})
    assert result.events == ["30 s: gps lost"]
    assert result.log_sha256 == hashlib.sha256(b"recorded").hexdigest()


def test_implausible_readings_last_until_they_are_plausible_again_or_the_log_ends(log: Log) -> None:
    """Times count from the first message of the IMU, as for runs; a second warning changes nothing."""

    def event(seconds: float, severity: str, compared: Comparison | None) -> LogEntry:
        return LogEntry(START_NS + round(seconds * 1e9), 0, Event(severity=severity, compared=compared))

    log.entries["/daq/event"] = entries_of([
        event(10, "warning", Comparison.AIRSPEED), event(12, "warning", None),
        event(15, "warning", Comparison.AIRSPEED), event(20, "info", Comparison.AIRSPEED),
        event(25, "info", Comparison.GPS), event(50, "warning", Comparison.MOTOR),
    ])  # fmt: skip
    results = [(item.compared, item.start_s, item.end_s) for item in made(log).implausible]
    assert results == [(Comparison.AIRSPEED, 10.0, 20.0), (Comparison.MOTOR, 50.0, 60.0)]


def test_a_log_of_an_autopilot_has_its_name(tmp_path: Path) -> None:
    write_ulog(
        tmp_path / "a.ulg",
        UlogContents([UlogTopic("airspeed", np.arange(3, dtype=np.uint64), {"a": np.zeros(3, np.float32)})]),
    )
    (tmp_path / "table.csv").write_text("time_s,a\n" + "".join(f"{i},{i}\n" for i in range(50)))
    named = [provenance_of_file(tmp_path / name, "given", None, "").recorded_by for name in ("a.ulg", "table.csv")]
    assert named == ["PX4", ""]
    ours = FlightRecording(tmp_path / "table.csv", {}, recorded_by="flightpower 1.2")
    assert provenance_of_file(ours.path, "given", None, "", ours).recorded_by == "flightpower 1.2"


def written_with(provenance: Provenance) -> bytes:
    """Return the results.json of a flight with this provenance."""
    condition = ConditionResult(weight_N=37.0, air_density_kgpm3=1.2)
    aircraft = AircraftResult(name="a", title="A", wing_area_m2=0.46, span_m=1.75, propeller="")
    kind = Kind.POWER_REQUIRED
    curves = {kind: CurveResult(condition=condition, points=[])}
    return to_json(
        Results(
            software_version="0", log="log.mcap", aircraft=aircraft, test=condition, kind=kind, curves=curves,
            provenance=provenance,
        )
    )  # fmt: skip


@pytest.mark.parametrize(("models", "notes"), [([8, 8], 0), ([None, None], 0), ([8, 0], 1)])
def test_a_receiver_that_smooths_velocity_is_noted(log: Log, models: list[int | None], notes: int) -> None:
    log.entries["/gps"] = entries_of([LogEntry(START_NS, 0, Gps(dynamic_model=model)) for model in models])
    assert len(receiver_notes(log)) == notes


def test_a_log_without_satellites_has_the_computer_s_date_or_none(log: Log) -> None:
    del log.entries["/gps"]
    assert made(log).start_utc is None
    log.entries = {"/imu": entries_of([LogEntry(1_463_218_140_000_000_000, 0, Imu())])}
    assert (made(log).start_utc, made(log).clock) == ("2016-05-14T09:29:00Z", "computer")


def test_each_file_has_its_origin_and_hash(log: Log, tmp_path: Path) -> None:
    own_file = tmp_path / "my.toml"
    own_file.write_bytes(b"mine")
    files = {f.role: f for f in made(log, replacements=Replacements(files={"aircraft.toml": str(own_file)})).files}
    assert (files["aircraft file"].origin, files["aircraft file"].sha256) == (
        str(own_file), hashlib.sha256(b"mine").hexdigest()
    )  # fmt: skip
    assert files["propeller table"].sha256 == hashlib.sha256(b"propeller.csv").hexdigest()
    assert files["probe calibration"].origin == "the log"
    shipped = {f.role: f for f in made(log, replacements=Replacements(files={"propeller.csv": "apc-12x8e"})).files}
    assert shipped["propeller table"].origin == "shipped with flightpower"
    assert made(log, replacements=Replacements(weight_N=40.0)).weight_source == "given with --weight"


@pytest.mark.parametrize(
    "command, says",
    [
        ("analyze elsewhere/log.mcap -q -o other", ""),
        ("analyze log.mcap --weight '4 kg'", "had other options: analyze log.mcap --usable=70%"),
        ("analyze --usable 70% log.mcap", "had other options"),
    ],
)
def test_only_other_options_are_reported(log: Log, tmp_path: Path, command: str, says: str) -> None:
    before = made(log, "analyze log.mcap --usable=70%" if says else "analyze log.mcap")
    if command.startswith("analyze --usable"):
        before = made(log, "analyze log.mcap --usable 80%")
    (tmp_path / "results.json").write_bytes(written_with(before))
    note = replaced(tmp_path, SimpleNamespace(provenance=made(log, command)))
    assert says in note and bool(note) == bool(says)


def test_tables_of_an_earlier_analysis_beside_the_new_ones_are_reported(log: Log, tmp_path: Path) -> None:
    now = SimpleNamespace(provenance=made(log))
    for name in ("power_required.csv", "path.csv", "electrical_power.csv", "notes.csv"):
        (tmp_path / name).write_text("", "utf-8")
    written = ("results.json", "electrical_power.csv", "report.html")
    assert replaced(tmp_path, now, written) == f"power_required.csv, path.csv in {tmp_path} are of an earlier analysis"
    (tmp_path / "results.json").write_text("{}")
    assert "not known; power_required.csv, path.csv in" in replaced(tmp_path, now, written)
    assert replaced(tmp_path, now, (*written, "power_required.csv")).endswith(
        f"; path.csv in {tmp_path} is of an earlier analysis"
    )


def test_another_log_or_file_is_reported(log: Log, tmp_path: Path) -> None:
    now = SimpleNamespace(provenance=made(log))
    assert replaced(tmp_path, now) == "", "there were no results before"
    (tmp_path / "results.json").write_text("{}")
    assert "not known" in replaced(tmp_path, now), "results of an earlier version have no provenance"
    (tmp_path / "results.json").write_bytes(written_with(now.provenance))
    log.attachments["probe.json"] = b"edited"
    assert "another probe calibration" in replaced(tmp_path, SimpleNamespace(provenance=made(log)))
    log.path.write_bytes(b"another")
    assert "another log" in replaced(tmp_path, SimpleNamespace(provenance=made(log)))


def test_autocorrelation_is_that_of_a_first_order_process() -> None:
    rng, x = np.random.default_rng(1), np.zeros(20_000)
    for i, noise in enumerate(rng.standard_normal(len(x) - 1), start=1):
        x[i] = 0.8 * x[i - 1] + noise
    assert autocorrelation(x, 4) == pytest.approx(0.8 ** np.arange(5), abs=0.03)
    assert len(autocorrelation(x[:6], 20)) == 4


def test_the_track_is_the_integral_of_velocity() -> None:
    """A circle of 100 m at 10 m/s closes after 2 pi 100/10 s, and is 200 m wide."""
    t = np.linspace(0, 20 * np.pi, 3001)
    states = pd.DataFrame({"v_north": 10 * np.cos(t / 10), "v_east": 10 * np.sin(t / 10)}, index=t)
    result = track(SimpleNamespace(states=states))
    assert len(result.t_s) <= 600
    assert max(result.east_m) == pytest.approx(200, abs=0.2) and max(result.north_m) == pytest.approx(100, abs=0.2)
    assert abs(result.north_m[-1]) < 2 and abs(result.east_m[-1]) < 1


def test_errors_of_parameters_are_correlated_by_noise_and_what_is_common_and_not_with_one_that_is_exact() -> None:
    noise, systematic = np.zeros((5, 5)), np.zeros((5, 5))
    noise[:2, :2] = [[3.0, -1.0], [-1.0, 8.0]]
    systematic[:2, :2] = [[1.0, -2.0], [-2.0, 1.0]]
    correlation = parameter_correlation(SimpleNamespace(noise=noise, systematic=systematic))  # type: ignore[arg-type]
    assert correlation.names[:2] == ["A0", "A1"] and len(correlation.names) == 5
    expected = np.zeros((5, 5))
    expected[:2, :2] = [[1.0, -0.5], [-0.5, 1.0]]  # -3 / (sqrt(4) sqrt(9))
    assert np.array(correlation.matrix) == pytest.approx(expected)
