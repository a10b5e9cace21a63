"""Several flights: a joint estimate, comparisons of two configurations, and a fleet (docs/understand/pooling.md).

`pool.pool_results` reads the results of flights, `comparison.compare` two pools. Flights are stacked along the first
axis of arrays. The shared parameters x (M,) are those of `flight_statistics.POOLED`: drag polar, corrections of thrust,
errors of the installation. `dataset.Dataset` keeps one row a flight, by airframe, in a folder or in object storage;
`airframes.airframes` pools the flights of each airframe and configuration, and `changes.find_changes` finds since when
an airframe has had more drag or less thrust. Nothing is imported here: the page needs the form of the results alone.
"""
