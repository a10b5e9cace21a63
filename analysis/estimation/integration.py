"""Rules that integrate a model's state over a step, for numbers and CasADi symbols; records and responses."""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

from flightpower.flight.arrays import Array

Integrator = Literal["rk4", "euler", "heun", "trapezoidal"]
InputRule = Literal["linear", "mean", "held"]
SAMPLES = 4096  # evaluated at once: the intermediate results then fit in the processor's cache


class Record(NamedTuple):
    """Initial state (states,), inputs (n, inputs), parameters (free and fixed, in model order), and step."""

    x0: Array
    U: Array
    p: Array
    step_s: float


class Response(NamedTuple):
    """x : (n, states)     y : (n, outputs)     S : (n, outputs, unknowns), dy/d(free parameters), then dy/dx0."""

    x: Array
    y: Array
    S: Array


Derivative = Callable[[Any, Any], Any]
InputAt = Callable[[float], Any]  # input as a function of the elapsed fraction of the step, 0 to 1


def euler(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """Euler's explicit method, first order (3.44)."""
    return x + h * f(x, u(0))


def heun(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """Heun's method, the explicit trapezoidal rule, second order."""
    k1 = f(x, u(0))
    return x + h / 2 * (k1 + f(x + h * k1, u(1)))


def rk4(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """Classical Runge-Kutta method, fourth order."""
    k1 = f(x, u(0))
    k2 = f(x + h / 2 * k1, u(0.5))
    k3 = f(x + h / 2 * k2, u(0.5))
    k4 = f(x + h * k3, u(1))
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


INPUT_RULES: dict[str, Callable[[Any, Any], InputAt]] = {
    "linear": lambda u0, u1: lambda s: u0 + s * (u1 - u0),
    "mean": lambda u0, u1: lambda s: (u0 + u1) / 2,
    "held": lambda u0, u1: lambda s: u0,
}
