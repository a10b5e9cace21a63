"""Whatever holds a flight becomes channels in SI units: logs of the daemon and of autopilots, telemetry, tables.

`recognize` says what a log is, `autopilot` and `table` read it into a `recording` or into messages of the daemon,
`daemon` brings a daemon's channels onto one grid, `rest` finds when the aircraft stands and the zeros of its sensors.
`laws` and `ranges` refuse impossible values.
"""
