"""The type of the quantities in the equations."""

from typing import Any, TypeAlias

# A float, a NumPy array or a CasADi symbol: the three share no type that mypy knows.
Number: TypeAlias = Any
