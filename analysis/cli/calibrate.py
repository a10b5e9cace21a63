"""`calibrate`: one module per command, with its arguments, messages and exit codes."""

from flightpower.analysis.calibrations.airspeed import airspeed
from flightpower.analysis.calibrations.boom import boom
from flightpower.analysis.calibrations.imu import imu
from flightpower.analysis.calibrations.magnetometer import magnetometer
from flightpower.analysis.calibrations.probe import probe
from flightpower.analysis.calibrations.run_up import run_up
from flightpower.analysis.calibrations.surfaces import surfaces
from flightpower.analysis.calibrations.thrust import thrust
from flightpower.analysis.calibrations.transducers import transducers
from flightpower.analysis.calibrations.tubing import tubing
from flightpower.analysis.calibrations.weight_and_balance import weight_and_balance
from flightpower.flight.command_line import application, run

app = application()


@app.callback()
def _group() -> None:
    """Calibrations: the probe in a wind tunnel; transducers, tubes, magnetometer, accelerometers, surfaces, thrust,
    vibration and boom on the ground; airspeed in flight; weight and balance."""


for command, short_help in (
    (probe, "The five-port probe, from a wind tunnel."),
    (tubing, "The lag of each pneumatic line, from steps of pressure."),
    (transducers, "Slope and offset of the transducers, from known pressures."),
    (airspeed, "Scale error of the airspeed, and wind, from a flight."),
    (magnetometer, "Hard and soft iron, from a log with turns."),
    (thrust, "Thrust at rest against the propeller's table, from a stand."),
    (run_up, "Vibration, motor and battery, from a strapped run-up."),
    (imu, "Scale and offset of the accelerometers, from six sides."),
    (boom, "Bending of the probe's boom, with weights on its tip."),
    (surfaces, "Surface angle and servo pulse, with a protractor."),
    (weight_and_balance, "Weight and center of gravity, from scales."),
):
    app.command(short_help=short_help)(command)


def main() -> None:
    run(app, "calibrate")
