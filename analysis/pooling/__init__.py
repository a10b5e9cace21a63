"""Several flights of one aircraft: a joint estimate, and comparisons of two (docs/understand/pooling.md).

`pool.pool_results` reads the results of flights, `comparison.compare` two pools. Flights are stacked along the first
axis of arrays. The shared parameters x (M,) are those of `flight_statistics.POOLED`: drag polar, corrections of thrust,
errors of the installation. Nothing is imported here: the page needs the form of the results alone.
"""
