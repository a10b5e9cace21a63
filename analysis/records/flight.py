"""The documented, versioned format of `results.json` and `power_required.csv` (docs/use/results.md).

Estimators return these records, and pages and tables are drawn from them, so each number is written once, where it is
computed. This module therefore imports nothing of the analysis. It is long, because it holds all fields of the one file
`results.json`, with their units. Intervals are 95 % intervals. `analysis.results.read` reads files of earlier formats.
"""

from datetime import datetime
from enum import StrEnum
from typing import Self

import msgspec

from flightpower.flight.messages import Comparison

FORMAT = "flightpower-results-3"
POOLING_FORMAT = "flightpower-pooling-3"
POWER_FORMAT = "flightpower-power-1"


class Kind(StrEnum):
    """The power that a curve shows."""

    POWER_REQUIRED = "power_required"  # thrust times airspeed
    ELECTRICAL = "electrical_power"  # from the battery
    SHAFT = "shaft_power"

    @property
    def words(self) -> str:
        return self.replace("_", " ")


class Cause(StrEnum):
    """The cause of a difference between two methods."""

    ANGLE_OF_ATTACK = "angle of attack"
    PITCH_ATTITUDE = "pitch attitude"
    AIRSPEED = "airspeed"
    AIR_DATA_LAG = "air-data lag"
    PROPELLER_TABLE = "propeller table"
    UNEXPLAINED = "unexplained"  # the part of a difference without a known cause


class SpeedReason(StrEnum):
    """The reason why a speed, or the lower end of its interval, is not given."""

    NONE = ""
    NO_OPTIMUM = "The curve has no such point."
    BELOW_SLOWEST = "It lies below the slowest speed flown."
    INTERVAL_BELOW_SLOWEST = "The interval reaches below the slowest speed flown."


class Clock(StrEnum):
    """The clock that gave the date and time of a log."""

    NONE = ""
    SATELLITES = "satellites"
    COMPUTER = "computer"  # the aircraft's computer, whose clock may be wrong


class CurveStatus(StrEnum):
    """How the estimation of the power curve ended."""

    CONVERGED = "converged"
    BY_ANOTHER_METHOD = "by another method"  # not by the dynamic method; see `methods_tried`
    NOT_CONVERGED = "not converged"  # the drag polar did not converge, is at a bound, or is not identifiable
    TRAJECTORY_NOT_CONVERGED = "trajectory not converged"

    @property
    def usable(self) -> bool:
        return self in (CurveStatus.CONVERGED, CurveStatus.BY_ANOTHER_METHOD)


class NextFlightLowers(StrEnum):
    """The source of error to reduce next: the largest part of the interval at the speed where it is widest."""

    NOTHING = ""  # nothing is lacking
    NOISE = "noise"
    ALPHA_BIAS = "alpha_bias"
    ALPHA_SCALE = "alpha_scale"
    V_SCALE = "V_scale"
    UPDRAFT = "updraft"
    PROPELLER = "propeller"
    ACCELEROMETER = "accelerometer"
    WEIGHT = "weight"
    DENSITY = "air_density"
    TRANSDUCERS = "transducers"
    AIRCRAFT_FILE = "aircraft_file"
    POLAR_SHAPE = "polar_shape"
    OTHER_SENSORS = "other_sensors"
    SHARED = "shared"


class MethodRejection(StrEnum):
    """The reason why a method on the ladder does not give the curve of a flight."""

    NONE = ""  # no reason: the method gives the curve
    NOT_FLOWN = "no maneuver that it needs was flown"
    NO_TRAJECTORY = "no flight path explains the measurements"
    MISFIT = "its flight path does not fit the measurements, and its curve is not to be trusted"
    NO_ESTIMATE = "the data do not suffice"
    UNPHYSICAL = "its drag polar is unphysical"
    NO_INFORMATION = "its 95 % interval is as large as the power itself"


class MethodTried(msgspec.Struct, frozen=True, kw_only=True):
    """A method that was tried for the curve of a flight, and the reason if it does not give the curve."""

    name: str
    title: str
    reason: MethodRejection
    text: str  # the reason with its cause; empty where the method gives the curve


class Trust(StrEnum):
    """How far the evidence allows a result to be trusted. Use a doubtful one with care; its evidence names the part in
    doubt."""

    TRUSTED = "trusted"
    DOUBTFUL = "doubtful"
    NOT_TO_BE_TRUSTED = "not to be trusted"


class EvidenceKind(StrEnum):
    """The kind of evidence that contradicts a result. The order is the report's: causes before their consequences."""

    NOT_CONVERGED = "not converged"
    TRAJECTORY_NOT_CONVERGED = "trajectory not converged"
    METHOD_FAILED = "method that the log allows"
    COUNTED_SPEED = "counted motor speed against the runs"
    MOTOR_LAG = "lag of the motor speed"
    OTHER_BLADES = "what the blades do beyond zero thrust"
    THRUST_TABLE = "thrust against the propeller's table"
    MOTOR_SPEED = "motor speed against the motor's constant"
    PROPELLER_EFFICIENCY = "propeller efficiency"
    MOTOR_EFFICIENCY = "motor efficiency"
    THRUST_EFFICIENCY = "efficiency from battery to thrust"
    LIFT_COEFFICIENT = "lift coefficient of the slowest speed"
    IMPLAUSIBLE_READINGS = "readings that cannot be true together"
    SENSOR_ERROR = "sensor error against its prior"
    SENSOR_ERRORS_TOGETHER = "sensor errors against their priors, together"
    RUN_AGAINST_OTHERS = "run against the other runs"
    INSTALLATIONS_DIFFER = "flights said to be of one installation"
    FLIGHTS_DIFFER = "flight against the other flights"
    OUTSIDE_TABLE = "outside the propeller's table"
    INTERVAL_REACHES_ZERO = "interval reaches zero"
    POLAR_CURVES_DOWNWARD = "drag polar curves downward"
    CROSS_CHECK = "cross-check"
    NO_VERDICT = "no verdict"  # the results are of an earlier version


class PartOfResult(StrEnum):
    """The part of a result that a piece of evidence concerns."""

    CURVE = "the whole curve"
    AT_SPEED = "the curve near one speed"
    POWER_TRAIN = "battery power, endurance and range"


class Evidence(msgspec.Struct, frozen=True, kw_only=True):
    """One piece of evidence against a result: a figure beyond its limit."""

    kind: EvidenceKind
    level: Trust
    part: PartOfResult = PartOfResult.CURVE
    log: str = ""  # log of the flight in doubt, in the results of several flights; empty where it concerns all
    subject: str = ""  # the run, the sensor error or the parameter; empty where `kind` already names it
    figure: float | None = None
    unit: str = "1"
    limit: float | None = None
    false_alarm_rate: float | None = None  # rate of this kind in sound flights; null where noise does not set the limit
    text: str  # what is wrong, and what to do


class RunAgainstOthers(msgspec.Struct, frozen=True, kw_only=True):
    """Power from one run alone and from the others of its kind, at the speed where their difference is known best."""

    run: str
    kind: str
    speed_mps: float
    power_W: float
    others_W: float
    standard_error_W: float  # of the difference
    z: float  # difference over its standard error; about normal with unit variance if there is no defect


class AutopilotParameter(msgspec.Struct, frozen=True, kw_only=True):
    """A value to type into an autopilot, with its 95 % interval."""

    firmware: str
    name: str
    versions: str  # versions of the firmware that have a parameter of this name
    value: float
    lo: float
    hi: float
    unit: str
    basis: str  # the results that the value follows from
    logged: float | None  # the parameter's value in the log


class PitchRateResult(msgspec.Struct, frozen=True, kw_only=True):
    """Test of whether the pitch rate in the runs was large enough to affect lift: significance of C_Lq (4.3)-(4.7)."""

    signal_to_noise: dict[str, float]  # by run: variance of the pitch rate over that of its noise
    noise_radps: float  # standard deviation of the pitch rate's noise in one sample
    CLq: float  # estimated without a prior
    standard_error: float  # for white residuals (4.2), as in the source
    standard_error_corrected: float  # for colored residuals
    t: float  # (4.4)
    critical_t: float
    significant: bool


class SourceFile(msgspec.Struct, frozen=True, kw_only=True):
    """A file that the analysis used."""

    # aircraft file, propeller table, calibration of probe, magnetometer or transducers, still-air zero, list of runs
    role: str
    name: str  # the name that the file itself states, or its path
    origin: str  # the log, shipped with flightpower, or the path given
    sha256: str  # hash of its bytes, hexadecimal; empty where it is not a single file


class SensorHealth(msgspec.Struct, frozen=True, kw_only=True):
    """Counts of the messages of one topic, from the sensor's first measurement on."""

    topic: str
    messages: int
    measurements: int
    faults: dict[str, int]  # number of messages by status, where the sensor reported or showed a fault


class ImplausibleReadings(msgspec.Struct, frozen=True, kw_only=True):
    """A period in which the daemon found in flight that readings could not all be true (`daq.plausibility`)."""

    compared: Comparison
    start_s: float  # on the same clock as the runs' times
    end_s: float


class Provenance(msgspec.Struct, frozen=True, kw_only=True):
    """Time and place of the log's recording, the equipment used, and how the log was analyzed."""

    command_line: str  # empty where the analysis was not started by a command
    log_sha256: str
    log_bytes: int
    recorded_by: str  # version of the daemon, or the autopilot's name (ticks is null then); empty: not in the log
    start_utc: str | None  # ISO 8601
    clock: Clock  # the clock that gave start_utc
    duration_s: float | None  # duration of the log
    latitude_deg: float | None  # place of the first satellite fix
    longitude_deg: float | None
    height_msl_m: float | None
    weight_source: str
    files: list[SourceFile]
    ticks: int | None  # ticks of the daemon; null where the log has none
    ticks_missed: int | None
    sensors: list[SensorHealth]
    events: list[str]  # warnings and errors of the daemon, each with its time in seconds from the start of the log
    implausible: list[ImplausibleReadings] = []


class AirFound(msgspec.Struct, frozen=True, kw_only=True):
    """The air during the runs, or the whole flight, as the flight shows it; a value that it does not show is null."""

    temperature_K: float | None = None
    pressure_Pa: float | None = None
    wind_mps: float | None = None
    wind_from_deg: float | None = None
    wind_standard_error_mps: float | None = None
    gust_mps: float | None = None  # vertical, 1 sigma
    gust_length: float = 1.0  # scale length of gusts over the standard's; not 1 if the flight's spectra contradict that
    density_altitude_m: float | None = None
    lowest_height_m: float | None = None  # lowest height in the runs, above the place of take-off
    highest_height_m: float | None = None


class RunResidual(msgspec.Struct, frozen=True, kw_only=True):
    """Statistics of measured minus modeled drag over mass in one run."""

    run: str
    kind: str = ""  # kind of the run; empty in results of earlier versions
    points: int
    step_s: float
    rms_mps2: float
    autocorrelation: list[float]  # at lags of 0, 1, 2, … steps


class Correlation(msgspec.Struct, frozen=True, kw_only=True):
    """Correlation matrix of the errors in the estimates of drag polar and thrust."""

    names: list[str]
    matrix: list[list[float]]


class Track(msgspec.Struct, frozen=True, kw_only=True):
    """The path over the ground, relative to its first point, from the reconstructed velocity."""

    t_s: list[float]
    north_m: list[float]
    east_m: list[float]


class PowerPoint(msgspec.Struct, frozen=True, kw_only=True):
    """One point of a curve with its 95 % interval."""

    speed_mps: float
    power_W: float
    power_lo_W: float
    power_hi_W: float
    extrapolated: bool = False  # outside the flown lift coefficients or the propeller's table


class MethodPoint(msgspec.Struct, frozen=True, kw_only=True):
    """One measured point, for a method that works on points, reduced to the test's weight and density."""

    speed_mps: float
    power_W: float
    power_lo_W: float | None = None
    power_hi_W: float | None = None
    start_s: float | None = None


class MethodResult(msgspec.Struct, frozen=True, kw_only=True):
    """Power required by one method, at the test's weight and density."""

    name: str
    title: str
    equations: str = ""
    taken_as_measured: list[str] = []  # quantities that it deliberately does not correct, so that errors show
    drag_polar: list[float] = []  # A0, A1, A2 of C_D = A0 + A1 C_L + A2 C_L^2
    power_required: list[PowerPoint] = []  # over the speeds of its data; empty without an estimate: `notes` say why
    points: list[MethodPoint] = []
    notes: list[str] = []
    not_flown: list[str] = []  # kinds of maneuver that the method needs, if none of them was flown


class DisagreementResult(msgspec.Struct, frozen=True, kw_only=True):
    """Two methods that differ by more than noise and a careful installation allow, and the likely cause."""

    methods: tuple[str, str]
    speed_mps: float  # where they differ most
    difference_W: float  # the second minus the first
    allowed_W: float  # three standard errors of the difference
    culprit: Cause
    text: str
    shares_W: dict[Cause, float] = {}  # how much of the difference each cause accounts for


class SpeedInterval(msgspec.Struct, frozen=True, kw_only=True):
    """A speed with its 95 % interval. The speed is null if the curve has none or it lies below the slowest speed flown.

    `inside_flown_range` is false where the speed is an extrapolation.
    """

    speed_mps: float | None
    lo_mps: float | None  # also null where the interval has no lower end
    hi_mps: float | None
    inside_flown_range: bool
    reason: SpeedReason = SpeedReason.NONE  # the reason why one of these is null


class SlowestFlown(msgspec.Struct, frozen=True, kw_only=True):
    """The slowest speed flown, at the test's weight and density, its lift coefficient, and the largest one in flight.

    The largest lift coefficient was reached for a moment, in turns, pull-ups or gusts. The wing did not stall at it, so
    it gives a lower limit for the margin to the stall.
    """

    speed_mps: float
    lift_coefficient: float
    largest_lift_coefficient: float


class ParameterResult(msgspec.Struct, frozen=True, kw_only=True):
    """An estimate and its standard error (corrected for colored residuals)."""

    name: str
    value: float
    standard_error: float
    unit: str


class SensorError(msgspec.Struct, frozen=True, kw_only=True):
    """The estimate of one systematic sensor error, and the things that the flight lacked to determine it better."""

    name: str
    title: str
    value: float
    standard_error: float
    assumed_sigma: float  # standard deviation of the prior
    unit: str
    determined: bool  # true if this flight determined it, and not the prior alone
    missing: list[str]  # reasons, with advice, if this flight did not determine it


class Check(msgspec.Struct, frozen=True, kw_only=True):
    """A difference that should be zero: its mean and scatter in flight."""

    title: str
    unit: str
    mean: float
    mean_standard_error: float
    sigma: float


class ConsistencyCheck(msgspec.Struct, frozen=True, kw_only=True):
    """Agreement of channels, as measured and after correction of sensor errors and gusts."""

    before: Check
    after: Check


class JointConflict(msgspec.Struct, frozen=True, kw_only=True):
    """Sensor errors of the first estimate that are plausible one by one but improbable together.

    errors : estimate less prior mean, over the standard deviation that this has if the prior is right
    probability : upper limit for the probability of errors this improbable, in a flight whose priors are right
    """

    errors: dict[str, float]
    probability: float


class PathResult(msgspec.Struct, frozen=True, kw_only=True):
    """Quality of the flight path, and the sensor errors estimated with it."""

    converged: bool
    gust_mps: float  # vertical, 1 sigma
    residuals: dict[str, float]  # rms by channel, in standard deviations of the channel's noise
    checks: list[ConsistencyCheck]
    sensor_errors: list[SensorError]
    # By sensor error that contradicts its prior in the first estimate: estimate less prior mean, in prior sigmas.
    prior_conflicts: dict[str, float] = {}
    joint_conflict: JointConflict | None = None


def run_name(kind: str, start_s: float) -> str:
    """The name of a run in estimates and figures."""
    return f"{kind} at {start_s:.0f} s"


class RunResult(msgspec.Struct, frozen=True, kw_only=True):
    kind: str
    start_s: float
    end_s: float
    lowest_speed_mps: float
    highest_speed_mps: float
    altitude_change_m: float
    notes: list[str]

    @property
    def name(self) -> str:
        return run_name(self.kind, self.start_s)


class RejectedResult(msgspec.Struct, frozen=True, kw_only=True):
    kind: str
    start_s: float
    end_s: float
    reason: str


class AircraftResult(msgspec.Struct, frozen=True, kw_only=True):
    name: str
    title: str
    wing_area_m2: float
    span_m: float
    propeller: str


class ConditionResult(msgspec.Struct, frozen=True, kw_only=True):
    """Weight and air density of a curve."""

    weight_N: float
    air_density_kgpm3: float


class DragPolar(msgspec.Struct, frozen=True, kw_only=True):
    """The drag polar C_D = A0 + A1 C_L + A2 C_L^2, which is also written C_D0 + K (C_L - C_L_minD)^2."""

    A0: float
    A1: float
    A2: float
    CD0: float
    K: float
    CL_minD: float
    oswald_efficiency: float
    maximum_lift_to_drag: float | None  # null if the estimate of drag at zero lift is negative


class IntervalPart(msgspec.Struct, frozen=True, kw_only=True):
    """The two parts of the half width of the 95 % interval; they add as squares."""

    speed_mps: float
    noise_W: float
    systematic_W: float  # errors that all runs share: sensors, propeller's table, alignment


class Interval(msgspec.Struct, frozen=True, kw_only=True):
    """A value with its 95 % interval."""

    value: float
    lo: float
    hi: float

    def times(self, factor: float) -> "Interval":
        return Interval(value=factor * self.value, lo=factor * self.lo, hi=factor * self.hi)


class LevelEfficiencyPoint(msgspec.Struct, frozen=True, kw_only=True):
    """Efficiencies (0 to 1) in steady level flight at the test's weight and density."""

    speed_mps: float
    propeller: Interval
    motor: Interval  # includes the speed controller
    overall: Interval
    extrapolated: bool


class MeasuredEfficiencyPoint(msgspec.Struct, frozen=True, kw_only=True):
    """Efficiencies (0 to 1) measured in a few seconds of steady or slowly changing flight, level or not."""

    time_s: float
    speed_mps: float
    propeller: float
    motor: float
    overall: float


class PowerTrainResult(msgspec.Struct, frozen=True, kw_only=True):
    measured: bool  # the losses are fitted to voltage and current of the battery
    basis: str = ""  # where the numbers come from, in words
    parameters: list[ParameterResult] = []
    efficiency: list[LevelEfficiencyPoint] = []
    points: list[MeasuredEfficiencyPoint] = []


class AvailableResult(msgspec.Struct, frozen=True, kw_only=True):
    """Performance at full throttle, at the test's weight and density."""

    reason: str = ""  # why full throttle is not known; empty where it is known
    basis: str = ""
    power_available: list[PowerPoint] = []
    climb_mps: list[float] = []  # at the same speeds
    maximum_speed_mps: Interval | None = None
    maximum_speed_extrapolated: bool = False
    best_climb_mps: Interval | None = None
    best_climb_speed_mps: float | None = None
    service_ceiling_m: Interval | None = None  # density altitude at which the best climb is 0.508 m/s (100 ft/min)
    absolute_ceiling_m: Interval | None = None
    notes: list[str] = []


class PerformanceCase(msgspec.Struct, frozen=True, kw_only=True):
    """Endurance, range and climb at one weight and density, each at its best speed among those flown. No interval of a
    speed reaches below the slowest speed flown."""

    title: str
    weight_N: float
    air_density_kgpm3: float
    density_altitude_m: float
    endurance_s: Interval
    endurance_speed_mps: Interval
    endurance_power_W: float  # from the battery
    endurance_at_slowest: bool  # the best speed is the slowest flown: power still falls there towards lower speeds
    endurance_at_fastest: bool = False  # the best speed is the fastest flown
    range_m: Interval
    range_speed_mps: Interval
    range_power_W: float
    range_at_slowest: bool = False
    range_at_fastest: bool = False
    maximum_speed_mps: Interval | None
    best_climb_mps: Interval | None
    extrapolated: bool = False  # one of these speeds lies outside the propeller's table


class FieldRow(msgspec.Struct, frozen=True, kw_only=True):
    """One line of the table that the pilot takes to the field."""

    speed_mps: float
    power_required_W: float
    battery_W: float
    endurance_s: float
    range_m: float
    climb_mps: float | None  # at full throttle
    extrapolated: bool


class PropellerRow(msgspec.Struct, frozen=True, kw_only=True):
    """One speed of rotation of a propeller's table."""

    rpm: float
    J: list[float]
    cT: list[float]
    cP: list[float]


class PropellerTable(msgspec.Struct, frozen=True, kw_only=True):
    name: str
    diameter_m: float
    beyond_zero_thrust: str
    rows: list[PropellerRow]


class ComputationModel(msgspec.Struct, frozen=True, kw_only=True):
    """The model that gives battery power at any weight, density, speed and climb (`analysis.performance`)."""

    names: list[
        str
    ]  # parameters of polar, thrust, angle of attack, losses, battery's meter, and of full throttle where it is known
    values: list[float]
    covariance: list[list[float]]
    no_load_torque_Nm: float
    flown_CL: tuple[float, float]
    propeller: PropellerTable


class PerformanceResult(msgspec.Struct, frozen=True, kw_only=True):
    """Performance with battery and propeller. `loadings` begins with the flight's own weight and density."""

    power_train: PowerTrainResult
    available: AvailableResult = AvailableResult()
    loadings: list[PerformanceCase] = []
    costs: list[str] = []  # effects of a change of weight alone and of air alone, if such conditions are computed
    field_table: list[FieldRow] = []
    too_much: list[str] = []  # requested conditions in which full throttle does not sustain level flight
    model: ComputationModel | None = None  # null in results of earlier versions


class PowerStatistics(msgspec.Struct, frozen=True, kw_only=True, tag_field="format", tag=POWER_FORMAT):
    """The statistics of a curve that pools and missions need: power at some speeds, with its errors."""

    speed_mps: list[float]
    power_W: list[float]
    own_covariance: list[list[float]]  # due to errors that are independent from flight to flight
    shared: dict[str, list[float]]  # change by one standard deviation of each error that flights share, by its name


class PriorMeasurementStatistics(msgspec.Struct, frozen=True, kw_only=True):
    """A linear combination of the parameters that was measured before the flight, as part of the prior."""

    name: str
    coefficients: dict[str, float]  # by name of the parameter
    value: float
    sigma: float


class PoolingStatistics(msgspec.Struct, frozen=True, kw_only=True, tag_field="format", tag=POOLING_FORMAT):
    """Sufficient statistics of one flight: estimates, their joint covariance, and the priors contained in both."""

    names: list[str]  # A0, A1, A2, corrections of thrust, then sensor errors
    values: list[float]
    covariance: list[list[float]]  # lower triangle; due to noise and sensor errors
    # Lower triangle. Covariance of the first names for given sensor errors and white residuals: it weighs the estimate.
    weighting_covariance: list[list[float]]
    prior_mean: list[float]
    prior_sigma: list[float | None]  # null where there is no prior
    prior_measurements: list[PriorMeasurementStatistics] | msgspec.UnsetType = msgspec.UNSET  # absent if there are none
    changes: dict[str, list[float]]  # change of the values by one standard deviation of each error no residual shows
    polar_covariance: list[list[float]]  # (3, 3) of this flight's own curve, due to all errors
    flown_CL: tuple[float, float]
    installation: str  # [installation] name of the aircraft file; empty where it has none
    propeller_table: str  # fingerprint
    probe_calibration: str  # fingerprint, with that of the transducers if there is one
    start_unix_s: float | None = None
    battery_V: float | None = None  # mean over the runs


class CurveResult(msgspec.Struct, frozen=True, kw_only=True):
    """Power of level flight over airspeed at one weight and density, and results that follow from it, for any kind.

    Best speeds are null where the curve alone gives none. For power required, endurance and range follow from the power
    train (`use`).
    """

    condition: ConditionResult
    points: list[PowerPoint]  # over the range flown
    standard: list[PowerPoint] = []  # at the standard weight and sea-level density
    least_power_speed: SpeedInterval | None = None  # speed of best endurance on this power
    best_range_speed: SpeedInterval | None = None  # least energy per distance; for power required, least drag
    endurance_s: Interval | None = None  # at the best speed, on the battery; null without a battery
    range_m: Interval | None = None
    interval_parts: list[IntervalPart] = []
    idle_power_W: float = 0.0  # part of the curve that is drawn with the motor off; independent of weight
    statistics: PoolingStatistics | PowerStatistics | None = None  # null where the curve cannot be pooled


class BatteryResult(msgspec.Struct, frozen=True, kw_only=True):
    """The battery for which endurance and range hold."""

    energy_Wh: float
    usable: float  # share of it that is used

    @property
    def usable_J(self) -> float:
        return 3600 * self.energy_Wh * self.usable


class EnergyBalanceResult(msgspec.Struct, frozen=True, kw_only=True):
    """Details of the energy balance of a whole flight, which gave the electrical curve."""

    residual_W: float  # rms of the residuals of the balance, as means over windows of about 8 s
    flown_s: float  # flight time that the balance uses
    airspeed_scale: (
        Interval | None
    )  # fraction by which airspeed reads high, from GPS and the prior; null without an airspeed sensor
    thrust_basis: str = ""  # where thrust comes from; empty where it is not known
    # Drag times airspeed over the motor's electrical power in level flight, from the flight's energy without a prior,
    # at the speed where it is known best. Null where it is not known, and for the log of a simulation, because no
    # meter measured its current. Earlier versions wrote null, or the curve's own estimate.
    thrust_efficiency: Interval | None = None
    # Shaft power from the propeller's table over the motor's electrical power, averaged over flight under power; null
    # where thrust is not known.
    shaft_over_electrical: float | None = None


UNKNOWN_SPEED = SpeedInterval(speed_mps=None, lo_mps=None, hi_mps=None, inside_flown_range=False)


class WithCurves(msgspec.Struct, frozen=True, kw_only=True):
    """Fields that a flight and a pool have in common, such as the curves by kind and their conditions."""

    format: str = ""
    trust: Trust = Trust.TRUSTED  # as bad as the worst evidence
    evidence: list[Evidence] = []  # evidence against the result, the worst first
    software_version: str
    aircraft: AircraftResult
    test: ConditionResult  # as flown; the mean of the flights of a pool
    kind: Kind  # kind of the curve that the report leads with
    curves: dict[Kind, CurveResult]
    air: AirFound = AirFound()
    battery: BatteryResult | None = None  # null where its energy is not known
    slowest_flown: SlowestFlown | None = None
    autopilot_parameters: list[AutopilotParameter] = []  # those that follow from the result
    autopilot_parameters_withheld: list[str] = []  # sentences on those that do not, with the reason

    @property
    def main(self) -> CurveResult:
        """The curve that the report leads with."""
        return self.curves[self.kind]

    def points(self, kind: Kind) -> list[PowerPoint]:
        """Points of a curve; empty if there is none of this kind."""
        return self.curves[kind].points if kind in self.curves else []

    @property
    def power_required(self) -> list[PowerPoint]:
        """Power required at the test's weight and density, over the flown range; empty where drag is not known."""
        return self.points(Kind.POWER_REQUIRED)

    @property
    def electrical_power(self) -> list[PowerPoint]:
        """Battery power in level flight; empty where it was not measured."""
        return self.points(Kind.ELECTRICAL)

    @property
    def best_range_speed(self) -> SpeedInterval:
        """Speed of least drag: the best range with an ideal power train."""
        required = self.curves.get(Kind.POWER_REQUIRED)
        return (required and required.best_range_speed) or UNKNOWN_SPEED

    @property
    def air_temperature_K(self) -> float | None:
        return self.air.temperature_K

    @property
    def air_pressure_Pa(self) -> float | None:
        return self.air.pressure_Pa

    def with_curve(self, kind: Kind, **changes: object) -> Self:
        """Return these results with some fields of one curve changed."""
        curve = msgspec.structs.replace(self.curves[kind], **changes)
        return msgspec.structs.replace(self, curves={**self.curves, kind: curve})


class Results(WithCurves, frozen=True, kw_only=True):
    """The contents of `results.json`."""

    format: str = FORMAT
    log: str
    # Identifies the board of the autopilot that wrote the log: 8 digits of a hash of its serial number, or empty.
    vehicle: str = ""
    standard: ConditionResult | None = None
    runs: list[RunResult] = []
    rejected: list[RejectedResult] = []
    parameters: list[ParameterResult] = []
    drag_polar: DragPolar | None = None  # null where drag is not known
    # Power required by output error on the runs alone, at the test's weight and density.
    cross_check: list[PowerPoint] = []
    cross_check_differs: bool = False  # it differs from power required by more than the 95 % band of the difference
    # How the estimation of the curve ended; null in results of earlier versions.
    status: CurveStatus | None = None
    verdict: str = ""  # the status in words, with the fault if there was one
    warnings: list[str] = []
    withheld: list[str] = []  # sentences on results that are not known, and on what it would take to know them
    methods_tried: list[MethodTried] = []  # the best first, down to the method that gives the curve of drag
    methods: list[MethodResult] = []
    # From each acceleration and deceleration alone, named by `title`.
    single_runs: list[MethodResult] = msgspec.field(default_factory=list, name="one_by_one")
    runs_against_others: list[RunAgainstOthers] = []
    # Gain of the log likelihood if the propeller, beyond zero thrust, folds although it is assumed to windmill, or the
    # other way around; absent where no run has such thrust.
    other_blades_gain: float | msgspec.UnsetType = msgspec.field(default=msgspec.UNSET, name="other_blades")
    # From the energy of the runs, if that gives the curve and both kinds were flown.
    accelerations_against_decelerations: RunAgainstOthers | msgspec.UnsetType = msgspec.UNSET
    disagreements: list[DisagreementResult] = []
    path: PathResult | None = None
    # Motor speed at full throttle over kV (V - I R); null if throttle, voltage, current or a constant is missing.
    speed_over_motor_constant: float | None = None
    use: PerformanceResult | None = None  # null where the propeller's table cannot give the thrust of level flight
    balance: EnergyBalanceResult | None = None  # null where the report leads with another power than the electrical one
    provenance: Provenance | None = None
    run_residuals: list[RunResidual] = []
    parameter_correlation: Correlation | None = None
    track: Track | None = None
    next_flight_lowers: NextFlightLowers = NextFlightLowers.NOTHING
    next_flight: list[str] = []  # sentences on the next twenty minutes to fly; empty if nothing is lacking
    pitch_rate: PitchRateResult | None = None  # with `--likelihood`

    @property
    def performance(self) -> PerformanceResult | None:
        """Endurance, range and full throttle, under the field name that a pool uses."""
        return self.use

    @property
    def source(self) -> str:
        """The flight that the results describe, as words for a message."""
        return f"the flight {self.log}"

    @property
    def power_required_standard(self) -> list[PowerPoint]:
        """Power required at the standard weight and sea-level density."""
        required = self.curves.get(Kind.POWER_REQUIRED)
        return required.standard if required else []

    @property
    def minimum_power_speed(self) -> SpeedInterval:
        """Speed of least power required: the best endurance with an ideal power train."""
        required = self.curves.get(Kind.POWER_REQUIRED)
        return (required and required.least_power_speed) or UNKNOWN_SPEED

    @property
    def interval_parts(self) -> list[IntervalPart]:
        """The parts of the interval of power required."""
        required = self.curves.get(Kind.POWER_REQUIRED)
        return required.interval_parts if required else []

    @property
    def start_unix_s(self) -> float | None:
        """Start of the log [s since 1970]; None where the log does not show it."""
        if self.pooling:
            return self.pooling.start_unix_s
        start = self.provenance.start_utc if self.provenance else None
        return datetime.fromisoformat(start).timestamp() if start else None

    @property
    def pooling(self) -> PoolingStatistics | None:
        """Statistics for the joint estimate of drag of several flights; None if the dynamic method gave no curve."""
        required = self.curves.get(Kind.POWER_REQUIRED)
        statistics = required and required.statistics
        return statistics if isinstance(statistics, PoolingStatistics) else None


def schema() -> bytes:
    """The JSON Schema of `results.json`; `docs/results.schema.json` is this."""
    return msgspec.json.format(msgspec.json.encode(msgspec.json.schema(Results)), indent=1) + b"\n"


if __name__ == "__main__":
    print(schema().decode(), end="")
