"""Settings for what results.json contains, and when it withholds a value."""

from dataclasses import dataclass

from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class ResultsSettings(Settings):
    """Lengths of written lists, and limits for withholding values."""

    longest_lag_s: float = setting(4.0, "s", "of autocorrelations: the gusts of a run are shorter")
    wide: float = setting(
        0.25, "1", "half of an interval over the power: with more, endurance may be a third less or two thirds more"
    )


@dataclass(frozen=True)
class TrustLimits(Settings):
    """Limits beyond which evidence makes a result doubtful."""

    false_alarm_rate: float = setting(
        0.003, "1", "of each kind of evidence that noise limits, in one sound flight: three kinds make one in 100"
    )
    beyond_doubt: float = setting(
        2.0, "1", "times the limit of doubt: even a table twice as uncertain as stated would be rejected"
    )
    best_propeller: float = setting(0.9, "1", "efficiency that no propeller of a model exceeds; the best have 0.85")
    least_power_train: float = setting(
        0.3,
        "1",
        "efficiency from battery to thrust: a motor of 0.6 with a propeller of 0.5; small aircraft have 0.4 to 0.7",
    )
    motor_constant: float = setting(
        0.1, "1", "of kV (V - I R): two poles more or less of 14 are 14 %; constants of makers differ by some percent"
    )

    @property
    def best_power_train(self) -> float:
        """Efficiency from battery to thrust. The best motors with controllers lose as much as the best propellers."""
        return self.best_propeller**2


TRUST = TrustLimits()
RESULTS = ResultsSettings()
