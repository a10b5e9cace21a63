"""Writes a log for `flightpower analyze` with the mcap library alone; log-format.md describes the format.

python write_log.py flight.csv flight.mcap aircraft.toml propeller.csv probe.json

flight.csv has a row for each instant, 25 a second: `time_s`, and the columns that FIELDS names, in SI units.
`gps_fix_type` may be left out. The attachments are found by their names, which must be exactly these three.
"""

import csv
import json
import sys
from pathlib import Path

from mcap.writer import Writer

# By topic, the fields of its messages and the column of flight.csv for each.
FIELDS = {
    "/imu": {f"specific_force_{axis}_mps2": f"a{axis}_mps2" for axis in "xyz"}
    | {f"angular_rate_{axis}_radps": f"{rate}_radps" for axis, rate in zip("xyz", "pqr", strict=True)},
    "/probe/alpha": {"differential_pressure_Pa": "dp_alpha_Pa"},
    "/probe/beta": {"differential_pressure_Pa": "dp_beta_Pa"},
    "/probe/airspeed": {"differential_pressure_Pa": "q_c_Pa"},
    "/static": {"pressure_Pa": "static_Pa", "temperature_K": "static_temperature_K"},
    "/rpm": {"motor_speed_revps": "n_revps"},
    "/gps": {f"velocity_{axis}_mps": f"gps_{axis}_mps" for axis in ("north", "east", "down")}
    | {"fix_type": "gps_fix_type"},
}
INTEGERS = ("fix_type",)


def write_log(table: Path, log: Path, attachments: list[Path]) -> None:
    with table.open(newline="") as rows, log.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="flightpower", library="write_log.py")
        for file in attachments:
            writer.add_attachment(0, 0, file.name, "text/plain", file.read_bytes())
        channels = {topic: writer.register_channel(topic, "json", schema_id=0) for topic in FIELDS}
        for number, row in enumerate(csv.DictReader(rows)):
            time_ns = round(float(row["time_s"]) * 1e9)
            for topic, columns in FIELDS.items():
                message = {
                    field: int(float(row[column])) if field in INTEGERS else float(row[column])
                    for field, column in columns.items()
                    if row.get(column)
                }
                if message:  # an empty cell was not measured
                    writer.add_message(channels[topic], time_ns, json.dumps(message).encode(), time_ns, number)
        writer.finish()


if __name__ == "__main__":
    write_log(Path(sys.argv[1]), Path(sys.argv[2]), [Path(name) for name in sys.argv[3:]])
