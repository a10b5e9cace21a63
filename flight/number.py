"""The type of the quantities in the equations."""

from typing import Any, TypeAlias

# A float, a NumPy array or a CasADi symbol: mypy knows no type that the three share.
Number: TypeAlias = Any
# Three components (x, y, z or north, east, down), or three angles (roll, pitch, yaw); or an array of three rows.
Vector: TypeAlias = Any
