"""The daemon on the aircraft: reads the tray on a fixed grid and never loses what it read.

Runs on a Raspberry Pi with few, light dependencies; imports only `flight` of ours, and no NumPy.
"""
