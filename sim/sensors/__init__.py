"""What the sensors of the tray feel on a flight, each with its own error budget, in physical units."""

from sim.sensors.budget import Budget, Errors, draw, load_budget
from sim.sensors.tray import TrayFelt

__all__ = ["Budget", "Errors", "TrayFelt", "draw", "load_budget"]
