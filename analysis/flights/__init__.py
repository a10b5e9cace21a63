"""Several flights: a joint estimate, comparisons of two configurations, and a fleet (docs/understand/pooling.md).

`pool.pool_results` pools flights from their results; `comparison.compare` compares two pools. Flights are stacked along
the first axis of arrays. The shared parameters x (M,) are the ones listed in `flight_statistics.POOLED`: drag polar,
corrections of thrust, errors of the installation. `dataset.Dataset` keeps one row per flight, by airframe, in a folder
or in object storage; `airframes.airframes` pools the flights of each airframe and configuration, and
`changes.find_changes` finds the flight since which an airframe has had more drag or less thrust. Nothing is imported
here: the page needs only the record types of the results.
"""
