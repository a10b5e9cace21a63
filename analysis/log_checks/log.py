"""The checks of a log before its channels are synchronized, in the order in which each needs those before it."""

from analysis.log_checks.clock import check_clock
from analysis.log_checks.messages import check_messages
from analysis.log_checks.units import check_units
from flight.log_reader import Log


def check_log(log: Log, propeller_diameter_m: float) -> None:
    """Raises InputError naming topic, field, the likely mistake and its remedy, for the first that is found."""
    check_messages(log)
    check_clock(log)
    check_units(log, propeller_diameter_m)
