"""Thrust of a propeller at rest over its table's: `calibrate thrust` measures the ratio, and an analysis applies it."""

from dataclasses import replace

import msgspec
import numpy as np

from flightpower.analysis.air.settings import STAND_LIMITS
from flightpower.analysis.settings import EVIDENCE
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.files import JsonFormat
from flightpower.flight.propeller import Propeller

FORMAT = "flightpower-thrust-stand-1"


class ThrustStand(msgspec.Struct, frozen=True, kw_only=True):
    """The content of the file that `calibrate thrust` writes."""

    format: str = FORMAT
    source: str
    propeller: str  # name of the table
    diameter_m: float
    readings: int
    revps: list[float]  # the speeds measured, ascending
    table_cT: list[float]  # thrust coefficients of the table at these speeds and J = 0
    ratio: float  # measured thrust over the table's
    ratio_error: float  # 1 sigma, the following three combined
    scatter_error: float
    scale_error: float  # of the stand, as given, as a fraction of thrust
    speed_error: float  # 0 where the ratio does not change with speed

    def applied_to(self, aircraft: Aircraft) -> Aircraft:
        """The aircraft with this measurement in place of its file's."""
        return replace(
            aircraft,
            propulsion=replace(aircraft.propulsion, static_thrust_ratio=self.ratio),
            uncertainty=replace(aircraft.uncertainty, static_thrust_ratio_fraction=self.ratio_error / self.ratio),
        )

    def check_table(self, propeller: Propeller, where: str) -> None:
        """Raises InputError naming `where` if the propeller's table is not the one that was compared."""
        cT = np.asarray(propeller.table(np.zeros(len(self.revps)), 60 * np.array(self.revps))[0])
        same_size = abs(propeller.diameter_m / self.diameter_m - 1) < EVIDENCE.negligible
        if not same_size or np.any(np.abs(cT / np.array(self.table_cT) - 1) > EVIDENCE.negligible):
            raise InputError(
                f"{where}: thrust on the stand was compared with another table ({self.propeller}) than that of this"
                f" analysis ({propeller.name}); repeat `calibrate thrust` with --propeller {propeller.name}"
            )


def _check(stand: ThrustStand, where: str) -> None:
    usable = (
        abs(stand.ratio - 1) <= STAND_LIMITS.largest_difference
        and 0 < stand.ratio_error <= STAND_LIMITS.largest_error * stand.ratio
        and stand.diameter_m > 0
        and 0 < len(stand.revps) == len(stand.table_cT)
        and min(stand.table_cT) > 0
    )
    if not usable:
        raise InputError(f"{where}: not a result of `calibrate thrust` (ratio {stand.ratio:g} ± {stand.ratio_error:g})")


THRUST_STAND_FILE = JsonFormat(ThrustStand, (FORMAT,), "a result of `calibrate thrust`", _check)
