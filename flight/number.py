"""The type of the quantities in the equations."""

from typing import Any, TypeAlias

# A float, a NumPy array or a CasADi symbol: the three share no type that mypy knows.
Number: TypeAlias = Any
# Three: components along x, y, z or north, east, down, or angles (roll, pitch, yaw); or an array of three rows.
Vector: TypeAlias = Any
