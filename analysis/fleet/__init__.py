"""Many airframes, many flights: statistics of flights as rows, curves by airframe and of the fleet, and changes.

`dataset.Dataset` keeps one row a flight, by airframe, in a folder or in object storage. `airframes.airframes` pools the
flights of each airframe and configuration, `airframes.fleet_curve` takes the airframes as draws of a fleet, and
`changes.find_changes` tells since when an airframe has had more drag or less thrust. The physics of a pool is that of
`analysis.pooling`.
"""
