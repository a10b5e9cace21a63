"""Flies the aircraft and says what every sensor would feel, in physical units.

The modules import only `flight` of ours; `sim.__main__`, the command line, is the top floor where simulator, fake
hardware and daemon meet.
"""
