"""What a log holds in addition to measurements, and what the source of its propeller table implies."""

from pathlib import Path

import msgspec
import pytest
from flights import tunnel_probe

from flightpower.analysis.air.airspeed_scale import AirspeedScale
from flightpower.analysis.air.contents import Replacements, contents
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller_files import load_propeller


@pytest.mark.parametrize(("in_file", "sigma"), [(True, 0.018), (False, 0.17)])
def test_thrust_of_a_computed_table_is_as_uncertain_as_the_file_says_or_as_such_tables_are(
    in_file: bool, sigma: float
) -> None:
    text = load_aircraft("nexstar").text
    log = Log(Path("flight.mcap"), attachments={
        "aircraft.toml": (text if in_file else text.partition("[uncertainty]")[0]).encode(),
        "propeller.csv": load_propeller("apc-12x8e").to_csv().encode(),
        "probe.json": msgspec.json.encode(tunnel_probe()),
    })  # fmt: skip
    log_contents = contents(log)
    assert log_contents.aircraft.uncertainty.thrust_scale_fraction == pytest.approx(sigma, abs=0.006)
    assert any("computed, not measured" in note for note in log_contents.notes) is not in_file
    measured = contents(log, Replacements(propeller=load_propeller("apc-11x5.5e")))
    assert measured.aircraft.uncertainty.thrust_scale_fraction == pytest.approx(0.018)


def test_a_damaged_propeller_table_in_a_log_is_said_to_be_the_log_s() -> None:
    """The message does not name the shipped table of the same name, which is intact."""
    table = load_propeller("apc-12x8e").to_csv().replace("0.10", "0.x0", 1)
    log = Log(Path("flight.mcap"), attachments={
        "aircraft.toml": load_aircraft("nexstar").text.encode(),
        "propeller.csv": table.encode(),
        "probe.json": msgspec.json.encode(tunnel_probe()),
    })  # fmt: skip
    with pytest.raises(InputError, match=r"^flight\.mcap: its propeller\.csv is damaged; give --propeller"):
        contents(log)


def test_a_scale_of_airspeed_belongs_to_an_aircraft_and_to_an_installation() -> None:
    """The installation in the tray file counts if the aircraft file names none."""
    log = Log(Path("flight.mcap"), attachments={
        "aircraft.toml": load_aircraft("nexstar").text.encode(),
        "propeller.csv": load_propeller("apc-12x8e").to_csv().encode(),
        "probe.json": msgspec.json.encode(tunnel_probe()),
        "tray.toml": b'[installation]\nname = "may"',
    })  # fmt: skip

    def notes(aircraft: str, installation: str) -> list[str]:
        scale = AirspeedScale(
            source="a.mcap", scale=0.01, scale_error=0.002, aircraft=aircraft, installation=installation
        )
        return contents(log, Replacements(airspeed=scale)).notes

    assert any("the installation april, and this flight has may" in note for note in notes("nexstar", "april"))
    assert not any("installation" in note for note in notes("nexstar", "may"))
    with pytest.raises(InputError, match=r"^--airspeed: was determined with the aircraft foamie, .* is of nexstar; "):
        notes("foamie", "may")
