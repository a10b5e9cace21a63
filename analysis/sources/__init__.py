"""Turns every record of a flight into channels in SI units: logs of the daemon and of autopilots, telemetry, tables.

`recognize` identifies the kind of log. `autopilot` reads it into a `recording`, `table` into messages of the daemon.
`daemon` puts a daemon's channels on one grid. `rest` finds when the aircraft stands still, and the sensors' zeros then.
`laws` and `ranges` reject impossible values.
"""
