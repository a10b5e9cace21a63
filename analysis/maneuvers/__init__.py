"""Finds maneuvers in the data: accelerations and decelerations, steady points, roller coasters, wind-up turns.

`kinds` names them, `quality` rejects unsuitable stretches and says why. `find_*` finds one sort each, `find` all of
them. `toml_file` writes the list to a file and reads an edited one.
"""
