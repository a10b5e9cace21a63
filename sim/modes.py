"""Computes small motions about a trim: the linearized aircraft and its modes."""

from dataclasses import dataclass

import numpy as np

from flightpower.flight.arrays import Array
from flightpower.sim.plant import AircraftState, Commands, Plant
from flightpower.sim.trim import Trim

LONGITUDINAL = ("u", "w", "q", "theta")
LATERAL = ("v", "p", "r", "phi")


@dataclass(frozen=True)
class Mode:
    """One mode. An aperiodic mode has an infinite period; a negative time constant means divergence."""

    name: str
    eigenvalue: complex

    @property
    def natural_frequency_radps(self) -> float:
        return abs(self.eigenvalue)

    @property
    def damping(self) -> float:
        return -self.eigenvalue.real / abs(self.eigenvalue)

    @property
    def period_s(self) -> float:
        return 2 * np.pi / abs(self.eigenvalue.imag) if self.eigenvalue.imag else np.inf

    @property
    def time_constant_s(self) -> float:
        return -1 / self.eigenvalue.real if self.eigenvalue.real else np.inf


def linearised(plant: Plant, trim: Trim, names: tuple[str, ...]) -> Array:
    """The system matrix (n, n) of these states about a trim, exact by CasADi; controls and motor speed fixed."""
    import casadi as ca

    ca.GlobalOptions.setNumpyMode(-1)
    x = ca.SX.sym("x", len(AircraftState._fields))
    rates = plant.derivative(AircraftState(*ca.vertsplit(x)), Commands(*trim.commands))
    chosen = [AircraftState._fields.index(name) for name in names]
    jacobian = ca.Function("A", [x], [ca.jacobian(ca.vertcat(*rates), x)])
    return np.array(jacobian(np.array(trim.state())))[np.ix_(chosen, chosen)]


def modes(plant: Plant, trim: Trim) -> list[Mode]:
    """Short period, phugoid, dutch roll, roll and spiral about a straight trim, in that order.

    A pair of eigenvalues that has become aperiodic is listed as two modes of the same name.
    """
    modes = []
    pairs = sorted(np.linalg.eigvals(linearised(plant, trim, LONGITUDINAL)), key=abs)
    for name, two in (("short period", pairs[2:]), ("phugoid", pairs[:2])):
        modes += _named(name, two)
    lateral = sorted(np.linalg.eigvals(linearised(plant, trim, LATERAL)), key=abs)
    oscillating = [e for e in lateral if abs(e.imag) > 1e-9]
    aperiodic = [e for e in lateral if abs(e.imag) <= 1e-9]
    modes += _named("dutch roll", oscillating[-2:])
    modes += [Mode(name, complex(e)) for name, e in zip(("roll", "spiral"), reversed(aperiodic), strict=False)]
    return modes


def _named(name: str, pair: list[complex]) -> list[Mode]:
    if len(pair) == 2 and abs(pair[0].imag) > 1e-9:
        return [Mode(name, complex(pair[0].real, abs(pair[0].imag)))]
    return [Mode(name, complex(e)) for e in pair]
