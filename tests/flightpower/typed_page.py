# The program of docs/understand/python.md, for `make types`; a test compares both.
from pathlib import Path

from flightpower import Options, analyze, compare, export, plan, pool, read, reasons_not_to_trust, tables, write_report

log = read("out/demo/log.mcap")
flight = analyze(log, Options(aircraft=Path("my.toml"), battery_Wh="5000 mAh, 14.8 V"))
print(flight.results.power_required[0].power_W, reasons_not_to_trust(flight.results))
curves = tables(flight)["curves"]
export(flight, "parquet", "tables")
write_report(flight, "report")

clean = pool([flight, "earlier.report/results.json"])  # one curve from several flights
print(clean.results().homogeneity, clean.power(clean.speeds_mps))
with_gear = pool(["gear-1.report/results.json", "gear-2.report/results.json"])
print(compare(clean, with_gear).results().differences)

print(plan("nexstar").half_widths)  # of the next flight, in % of power
