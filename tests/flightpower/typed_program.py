"""What type checkers see of `import flightpower`: for `make types`, which also fails if a checker misses a mistake."""

from pathlib import Path

from flightpower import Comparison, Flight, Options, Pool, analyze, compare, estimation, plan, pool, read, tables

flight: Flight = analyze(read("log.mcap"), Options(aircraft=Path("my.toml"), weight_N=39.2))
power_W: float = flight.results.power_required[0].power_W
many: Pool = pool([flight, "results.json"])
difference: Comparison = compare(many, many)
p: float = difference.results().p
names: list[str] = list(tables(flight))
wind_kt: float = plan("nexstar").request.wind_kt
fitted: type[estimation.Model] = estimation.Model
wrong: str = flight.results.power_required[0].power_W  # type: ignore[assignment]
analyze("log.mcap", Options(mass="9 kg"))  # type: ignore[call-arg]
