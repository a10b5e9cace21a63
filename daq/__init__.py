"""The daemon on the aircraft: reads the sensors of the tray on a fixed time grid and records them.

Runs on a Raspberry Pi. Imports of this project only `flight`, and not NumPy.
"""
