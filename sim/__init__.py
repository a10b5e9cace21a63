"""Flight simulator: flies the aircraft and gives the physical input of every sensor.

The modules import only `flight` of this project. The command, `flightpower.simulate`, joins simulator, fake sensors and
daemon.
"""
