"""The part of `results.json` that says what the results were made of: log, files, air, runs' residuals, track."""

import msgspec


class SourceFile(msgspec.Struct, frozen=True, kw_only=True):
    """A file that the analysis used."""

    # aircraft file, propeller table, calibration of probe, magnetometer or transducers, still-air zero, list of runs
    role: str
    name: str  # that the file states inside, or its path
    origin: str  # the log, shipped with flightpower, or the path given
    sha256: str  # of its bytes, hexadecimal; empty where it is not a single file


class SensorHealth(msgspec.Struct, frozen=True, kw_only=True):
    """Messages of one topic from the sensor's first measurement on."""

    topic: str
    messages: int
    measurements: int
    faults: dict[str, int]  # number of messages by status, where the sensor reported or showed a fault


class Provenance(msgspec.Struct, frozen=True, kw_only=True):
    """When and where the log was recorded, with what, and how it was analysed."""

    command_line: str  # empty where the analysis was not started by a command
    log_sha256: str
    log_bytes: int
    recorded_by: str  # version of the software that wrote the log; empty where the log does not say
    start_utc: str | None  # ISO 8601
    clock: str  # that start_utc is from: satellites, computer; empty without one
    duration_s: float | None  # of the log
    latitude_deg: float | None  # of the first satellite fix
    longitude_deg: float | None
    height_msl_m: float | None
    weight_source: str
    files: list[SourceFile]
    ticks: int | None  # of the daemon; null where the log has none
    ticks_missed: int | None
    sensors: list[SensorHealth]
    events: list[str]  # warnings and errors of the daemon, with the second of the log


class AirFound(msgspec.Struct, frozen=True, kw_only=True):
    """The air of the runs, as the flight itself found it."""

    wind_mps: float
    wind_from_deg: float
    wind_standard_error_mps: float
    gust_mps: float  # vertical, 1 sigma
    gust_length: float = 1.0  # scale length over the standard's, which the flight's spectra may deny
    temperature_K: float
    density_altitude_m: float
    lowest_height_m: float  # of the runs, above the place of take-off
    highest_height_m: float


class RunResidual(msgspec.Struct, frozen=True, kw_only=True):
    """Drag over mass of one run, measured less modelled."""

    run: str
    points: int
    step_s: float
    rms_mps2: float
    autocorrelation: list[float]  # at lags of 0, 1, 2, … steps


class Correlation(msgspec.Struct, frozen=True, kw_only=True):
    """Correlation of the errors of the drag polar's and the thrust's estimates."""

    names: list[str]
    matrix: list[list[float]]


class Track(msgspec.Struct, frozen=True, kw_only=True):
    """The path over the ground from the first instant on, by the reconstructed velocity."""

    t_s: list[float]
    north_m: list[float]
    east_m: list[float]
