"""The measurements of the tray's sensors on a simulated flight, in physical units, each with its own error budget."""

from flightpower.sim.sensors.budget import DrawnErrors, ErrorBudget, draw, load_budget
from flightpower.sim.sensors.tray import FlightSensorTruth

__all__ = ["DrawnErrors", "ErrorBudget", "FlightSensorTruth", "draw", "load_budget"]
