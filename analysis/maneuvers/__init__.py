"""Finds maneuvers in the data: accelerations and decelerations, steady points, roller coasters, wind-up turns.

`kinds` lists the kinds of maneuver, `quality` says why data are unsuitable. Each `find_*` finds one group of kinds,
`find` all of them. `toml_file` writes them to a file and reads an edited one.
"""
