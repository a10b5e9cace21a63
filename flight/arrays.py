"""Types of NumPy arrays for signatures; docstrings state the shapes."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
