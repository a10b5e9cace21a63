"""Scale of the airspeed: `calibrate airspeed` determines it in one flight, and analyses of other flights apply it."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pandas as pd

from flightpower.analysis.air.settings import GROUND
from flightpower.analysis.sources.recording import AIRSPEED_PRESSURE, Channel, FlightRecording
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.files import JsonFormat, sha256_of

FORMAT = "flightpower-airspeed-1"


class AirspeedScale(msgspec.Struct, frozen=True, kw_only=True):
    """The content of the file that `calibrate airspeed` writes; its wind belongs to that flight and is not used.

    aircraft, installation : names in that flight's log; older files and files from autopilots' logs have none
    """

    format: str = FORMAT
    source: str  # name of the log
    log_sha256: str = ""
    aircraft: str | msgspec.UnsetType = msgspec.UNSET
    installation: str | msgspec.UnsetType = msgspec.UNSET
    scale: float  # fraction by which airspeed reads high
    scale_error: float  # 1 sigma

    @property
    def pressure_factor(self) -> float:
        """Ratio of dynamic pressure to its reading; airspeed goes with its square root."""
        return (1 + self.scale) ** -2

    def corrected(self, table: pd.DataFrame) -> pd.DataFrame:
        """The table with column q_c_Pa, from which the zero has been subtracted, corrected for the scale."""
        return table.assign(q_c_Pa=self.pressure_factor * table["q_c_Pa"])

    def corrected_recording(self, recording: FlightRecording) -> FlightRecording:
        """The recording with the true airspeed pressure. Raises InputError where it has none."""
        pressure = recording.channels.get(AIRSPEED_PRESSURE)
        if pressure is None:
            raise InputError(f"{recording.path}: --airspeed: has no effect, since the log lacks airspeed; leave it out")
        corrected = Channel(pressure.t_s, np.asarray(self.pressure_factor * pressure.value))
        return replace(recording, channels={**recording.channels, AIRSPEED_PRESSURE: corrected})

    def check_other_flight(self, log: Path, where: str) -> None:
        """Raises InputError naming `where` if the scale was determined from this very log."""
        if self.log_sha256 and self.log_sha256 == sha256_of(log):
            raise InputError(
                f"{where}: was determined from this very flight, which would count twice; leave --airspeed out, as"
                " `analyze` estimates the scale itself"
            )

    def notes_on_aircraft(self, aircraft: Aircraft, where: str) -> list[str]:
        """A note if the scale was determined with another installation than this flight has.

        Raises InputError naming `where` if it was determined with another aircraft. An installation without a name is
        not compared.
        """
        if self.aircraft and self.aircraft != aircraft.name:
            raise InputError(
                f"{where}: was determined with the aircraft {self.aircraft}, and this flight is of {aircraft.name};"
                f" leave --airspeed out, or run `calibrate airspeed` on a flight of {aircraft.name}"
            )
        installation = aircraft.installation.name
        if self.installation and installation and self.installation != installation:
            return [
                f"{where}: the scale of airspeed was determined with the installation {self.installation}, and this"
                f" flight has {installation}: if the probe was moved in between, leave --airspeed out."
            ]
        return []


def _check(scale: AirspeedScale, where: str) -> None:
    if not (abs(scale.scale) < GROUND.largest_gain_error and 0 < scale.scale_error < GROUND.largest_gain_error):
        raise InputError(f"{where}: not an airspeed calibration (scale {scale.scale:g} ± {scale.scale_error:g})")


AIRSPEED_FILE = JsonFormat(AirspeedScale, (FORMAT,), "an airspeed calibration", _check)
