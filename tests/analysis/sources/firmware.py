"""How a dataflash log identifies its vehicle type."""

import numpy as np

from flightpower.sim.dataflash_writer import DataflashMessages


def firmware(text: str = "ArduPlane V4.5.7 (0f1e2d3c)") -> DataflashMessages:
    """The message with the name of the firmware."""
    return DataflashMessages("MSG", "QZ", {"TimeUS": np.zeros(1), "Message": np.array([text.encode()])})
