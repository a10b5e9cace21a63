"""Finds maneuvers in the data: accelerations and decelerations, steady points, roller coasters, wind-up turns.

`find` finds all maneuvers of a flight, each `find_*` one group of kinds; `kinds` lists the kinds, and the reasons why a
stretch is not a maneuver; `quality` smooths the motion and says why data are unsuitable; `settings` has the criteria,
except those of level runs, which the pilot's monitor shares (`flight.runs`). `runs_file` writes the maneuvers to a file
and reads an edited one.

A *maneuver* is a range of rows of the table of air data (`analysis.air`) with a kind. A *run* is a level
acceleration or deceleration; a *steady point* is level flight at constant speed. Speed V [m/s], its slope Vdot [m/s^2]
and the climb rate [m/s] come from a local quadratic, bank [rad] is positive with the right wing down, and the load
factor n is 1 in level flight. The aircraft's *speed scale* multiplies accelerations, climb rates, heights and
durations.
"""
