"""The daemon on the aircraft: reads the sensors of the tray on a fixed time grid and records them.

It runs on a Raspberry Pi, and imports only `flight` of this project, and not NumPy.
"""
