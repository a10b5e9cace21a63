"""Flight simulator: flies the aircraft and gives the physical input of every sensor.

The modules import only `flight` of this project. Only the command line, `sim.__main__`, connects simulator, fake
hardware and daemon.
"""
