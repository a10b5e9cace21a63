"""Compares the electrical curves of two flights in ArduPlane's own simulation with level flight in calm air.

    python benchmarks/firmware_flights.py FOLDER      # with the files arduplane-4.6-dev-sitl-*.BIN.gz

The truth comes from the calm flight: its power in windows in which true height and airspeed are constant.
"""

import gzip
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate, estimate
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.methods.whole_flight.simulated_truth import SimulatedTruth, compared
from flightpower.analysis.performance.autopilot_parameters import flight_values, typed_in
from flightpower.analysis.records.flight import UNKNOWN_SPEED
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.flight.units import GRAVITY_MPS2 as g

Array = NDArray[np.float64]

WEIGHT_N, AREA_M2, SPAN_M = 2.0 * g, 0.45, 1.88
SPEEDS_MPS = np.array([14.4, 16.5, 17.6, 19.6, 22.7, 25.7, 28.9])  # true airspeeds
TRUTH_W = np.array([31.6, 47.0, 59.8, 89.9, 157.1, 255.7, 396.5])
TRUE_RATIO = 2.0  # value of ARSPD_RATIO
FLIGHTS = {"calm": "arduplane-4.6-dev-sitl-calm.BIN.gz", "4 m/s of wind": "arduplane-4.6-dev-sitl-4mps.BIN.gz"}


class OfFlight(NamedTuple):
    """error, half : of power, in percent of the truth, at SPEEDS_MPS     ratio : limits of ARSPD_RATIO"""

    electrical: ElectricalEstimate
    error: Array
    half: Array
    ratio: tuple[float, float]
    simulated: SimulatedTruth | None


def of_flight(path: Path) -> OfFlight:
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.BIN"
        log.write_bytes(gzip.decompress(path.read_bytes()))
        recording = read_ardupilot(log)
    table = flight_table(recording, WEIGHT_N, AREA_M2)
    electrical = estimate(table, WEIGHT_N, AREA_M2, SPAN_M)
    power, sigma = (
        np.interp(SPEEDS_MPS, electrical.V_mps, values) for values in (electrical.power_W, electrical.standard_error_W)
    )
    parameters, _ = typed_in(flight_values(electrical, UNKNOWN_SPEED, recording.parameters))
    (ratio,) = (parameter for parameter in parameters if parameter.name == "ARSPD_RATIO")
    error, half = 100 * (power / TRUTH_W - 1), 100 * NORMAL_95 * sigma / TRUTH_W
    return OfFlight(electrical, error, half, (ratio.lo, ratio.hi), compared(recording, table, electrical))


def main(folder: Path) -> None:
    print("true airspeed, m/s  ", *(f"{V:6.1f}" for V in SPEEDS_MPS))
    for name, file in FLIGHTS.items():
        flight = of_flight(folder / file)
        print(f"{name:13} error, %", *(f"{x:+6.1f}" for x in flight.error))
        print(f"{'':9} half width, %", *(f"{x:6.1f}" for x in flight.half))
        inside = int((np.abs(flight.error) < flight.half).sum())
        print(f"  inside at {inside} of {len(SPEEDS_MPS)}; ARSPD_RATIO {flight.ratio[0]:.3f} to {flight.ratio[1]:.3f}, "
              f"true {TRUE_RATIO}; {flight.simulated.sentence() if flight.simulated else ''}")  # fmt: skip


if __name__ == "__main__":
    main(Path(sys.argv[1]))
