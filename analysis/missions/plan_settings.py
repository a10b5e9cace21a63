"""What a plan assumes about aircraft, pilot and air, and its margins."""

from dataclasses import dataclass

from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class Trainer(Settings):
    """An aircraft about which nothing else is known; its drag is the median of the prior in
    `analysis.methods.whole_flight.settings`."""

    largest_CL: float = setting(1.2, "1", "of a plain wing without flaps")
    CL_at_zero_alpha: float = setting(0.3, "1", "of a cambered airfoil, body axis along the fuselage")
    fastest_over_stall: float = setting(2.4, "1", "level, where the aircraft file has no motor")


TRAINER = Trainer()


@dataclass(frozen=True)
class Margins(Settings):
    """Margins over the stall and below full power."""

    slowest: float = setting(1.08, "1", "slowest speed over the stall in still air, at which a deceleration ends")
    slowest_per_kt: float = setting(0.002, "1/kt", "added for each knot of wind at 20 ft, for its gusts")
    hold: float = setting(1.04, "1", "of a speed that is held, over the slowest")
    fastest: float = setting(0.92, "1", "of the fastest level speed, which is approached for minutes")
    cruise: float = setting(1.6, "1", "speed between maneuvers, and of the turn after a run, over the stall")


MARGINS = Margins()


@dataclass(frozen=True)
class Leg(Settings):
    """Length of straight flight over the ground, if the user gives none."""

    length_m: tuple[float, float] = setting(
        (500.0, 1300.0),
        "m",
        "in line of sight of a pilot on the ground; of an autopilot, as docs/use/flying.md compares",
    )


LEG = Leg()


@dataclass(frozen=True)
class Maneuvers(Settings):
    """How the pieces are flown."""

    stand_s: tuple[float, float] = setting(
        (90.0, 30.0), "s", "before, zeros and noise of all sensors; after, their drift"
    )
    acceleration_throttle: float = setting(0.87, "1", "thrust that a battery half empty still gives")
    deceleration_throttle: float = setting(0.495, "1", "the propeller still pulls, where its table is best known")
    deceleration_ramp_s: float = setting(2.5, "s", "no faster than a pilot holds height")
    banks_rad: tuple[float, float] = setting(
        (0.6, 0.8), "rad", "34°: load factor 1.2; where there is little room 46°: load factor 1.4"
    )


MANEUVERS = Maneuvers()


@dataclass(frozen=True)
class PlannedPath(Settings):
    """Kinematics of a plan that is flown exactly as written."""

    step_s: float = setting(0.04, "s", "that of the logger")
    take_off_s: float = setting(12.0, "s", "from standing to the least height at which anything is measured")
    climb_over_stall: float = setting(0.3, "1", "rate of climb over the stall speed: 3 m/s of a trainer")
    speed_lag_s: float = setting(2.0, "s", "of a pilot who changes speed")
    hardest_mps2: float = setting(1.5, "m/s²", "of a change of speed between maneuvers")
    roll_s: float = setting(1.0, "s", "into and out of a turn")
    wind_from_deg: float = setting(-50.0, "deg", "oblique to the legs: neither head wind nor cross wind alone")


PATH = PlannedPath()


@dataclass(frozen=True)
class ExpectedNoise(Settings):
    """Assumptions for the uncertainty that a flight will leave, which is computed before the flight."""

    residuals_in_gusts: tuple[tuple[float, float], ...] = setting(
        ((0.0, 0.029), (0.15, 0.040), (0.75, 0.060)),
        "m/s, m/s²",
        "gusts, 1 sigma, and residuals of drag over mass, means over 0.2 s, in simulated flights in them",
    )
    rest_share: float = setting(
        0.8, "1", "of the residuals; errors of the states make the rest. White noise of it has the same effect"
    )


NOISE = ExpectedNoise()


@dataclass(frozen=True)
class Search(Settings):
    """How the pieces are chosen."""

    mean_share: float = setting(0.1, "1", "of the mean half width over speeds, besides the worst")
    fewest_run_pairs: int = setting(2, "1", "a single one does not show repeatability")
    least_left: float = setting(
        0.02, "1", "share of the information, in every direction, that remains when a piece is removed"
    )


SEARCH = Search()
