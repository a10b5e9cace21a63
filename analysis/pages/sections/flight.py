"""What was flown, and with what equipment: runs and rejected stretches, agreement of sensors, origin of every input."""

import math
from typing import NamedTuple

from flightpower.analysis.pages.html_page import HtmlTable
from flightpower.analysis.records.flight import AirFound, Clock, Provenance, Results, SensorError
from flightpower.flight.settings import NORMAL_95
from flightpower.flight.units import GRAVITY_MPS2


class FlightSection(NamedTuple):
    runs: HtmlTable
    rejected: HtmlTable | None


def flight_section(results: Results) -> FlightSection | None:
    """Return the section; None for a flight without runs."""
    if not results.runs and not results.rejected:
        return None
    runs = [
        (
            f"{number}",
            run.kind,
            f"{run.start_s:.1f}",
            f"{run.end_s - run.start_s:.1f}",
            f"{run.lowest_speed_mps:.1f} to {run.highest_speed_mps:.1f}",
            f"{run.altitude_change_m:+.1f}",
            "; ".join(run.notes),
        )
        for number, run in enumerate(results.runs, start=1)
    ]
    rejected = [(r.kind, f"{r.start_s:.1f}", f"{r.end_s - r.start_s:.1f}", r.reason) for r in results.rejected]
    return FlightSection(
        HtmlTable(("", "run", "start, s", "length, s", "speed, m/s", "height change, m", "notes"), runs),
        HtmlTable(("similar to", "start, s", "length, s", "reason"), rejected) if rejected else None,
    )


CHANNELS = {
    "V": "airspeed", "alpha": "angle of attack", "beta": "sideslip", "height": "barometer",
    "gps_north": "GPS north", "gps_east": "GPS east", "gps_down": "GPS down", "compass": "compass",
    "v_north": "velocity north at rest", "v_east": "velocity east at rest", "v_down": "velocity down at rest",
}  # fmt: skip


class SensorsSection(NamedTuple):
    checks: HtmlTable
    residuals: str
    errors: HtmlTable


def sensors_section(results: Results) -> SensorsSection | None:
    """Return the section; None if no trajectory was reconstructed."""
    path = results.path
    if path is None:
        return None
    checks = [
        (check.before.title, *(f"{c.mean:+z.2f} ± {c.sigma:.2f} {c.unit}" for c in (check.before, check.after)))
        for check in path.checks
    ]
    residuals = (f"{title} {path.residuals[name]:.1f}" for name, title in CHANNELS.items() if name in path.residuals)
    return SensorsSection(
        HtmlTable(("difference in flight, mean ± standard deviation", "before", "after"), checks),
        ", ".join(residuals),
        HtmlTable(
            ("sensor error", "estimate ± 1 sigma", "assumed before the flight", "determined by this flight?"),
            [_error_row(error) for error in path.sensor_errors],
        ),
    )


def _error_row(error: SensorError) -> tuple[str, str, str, str]:
    digits = decimals(error.standard_error)
    return (
        error.title,
        f"{error.value:+.{digits}f} ± {error.standard_error:.{digits}f} {error.unit}",
        f"± {error.assumed_sigma:.3g}",
        "yes" if error.determined else "no: " + "; ".join(error.missing),
    )


def decimals(sigma: float) -> int:
    """Return how many decimals show two significant digits of a standard error."""
    return max(0, 1 - math.floor(math.log10(sigma))) if sigma > 0 else 2


class ProvenanceSection(NamedTuple):
    """date_and_place: for the head of the page. wind: for the map. facts: each a name and a text."""

    date_and_place: str
    wind: str
    facts: list[tuple[str, str]]
    files: HtmlTable
    sensors: HtmlTable


def provenance_section(results: Results) -> ProvenanceSection | None:
    """Return the section; None if the results do not name their inputs."""
    provenance = results.provenance
    if provenance is None:
        return None
    date_and_place = "; ".join((_date(results), _place(results)))
    facts = [
        ("Date and place", date_and_place),
        *_air(results),
        ("Weight", f"{results.test.weight_N / GRAVITY_MPS2:.3f} kg, {provenance.weight_source}"),
        ("Log", _log(results, provenance)),
        ("Recorded by", _recorder(results, provenance)),
        *_of_daemon(results, provenance),
        ("Analyzed by", f"flightpower {results.software_version}"),
        ("Command", provenance.command_line or "not recorded: one of several logs, or called from Python"),
    ]
    return ProvenanceSection(
        date_and_place=date_and_place,
        wind=_wind(results),
        facts=facts,
        files=HtmlTable(
            ("file", "name", "from", "SHA-256"),
            [
                (file.role, file.name or "–", file.origin, file.sha256 or "not a single file")
                for file in provenance.files
            ],
        ),
        sensors=HtmlTable(
            ("topic", "messages", "measurements", "faults"),
            [
                (
                    sensor.topic,
                    str(sensor.messages),
                    str(sensor.measurements),
                    ", ".join(f"{number} {status}" for status, number in sensor.faults.items()) or "none",
                )
                for sensor in provenance.sensors
            ],
            numbers=True,
        ),
    )


def _recorder(results: Results, provenance: Provenance) -> str:
    if results.vehicle:
        return f"{provenance.recorded_by or 'autopilot'} {results.vehicle} (hash of its serial number)"
    if not provenance.recorded_by:
        return "not known"
    return provenance.recorded_by if provenance.ticks is None else f"flightpower {provenance.recorded_by}"


def _of_daemon(results: Results, provenance: Provenance) -> list[tuple[str, str]]:
    """Return facts that only our own recorder logs."""
    if provenance.ticks is None:
        return []
    return [("Sampling", _ticks(results)), ("Messages of the daemon", "; ".join(provenance.events) or "no warning")]


def _log(results: Results, provenance: Provenance) -> str:
    length = "" if provenance.duration_s is None else f" {provenance.duration_s:.0f} s,"
    return f"{results.log},{length} {provenance.log_bytes / 1e6:.1f} MB, SHA-256 {provenance.log_sha256}"


class BalanceSection(NamedTuple):
    """The energy balance of a whole flight: wind, airspeed, and residuals."""

    air: str
    residual: str


def balance_section(results: Results) -> BalanceSection | None:
    """Return the section; None if the curve is not from an energy balance."""
    balance = results.balance
    if balance is None:
        return None
    residual = (
        f"Thrust power minus the power of drag and of the change of energy, {balance.residual_W:.0f} W rms over"
        f" {balance.flown_s:.0f} s. It shows the vertical motion of the air. The interval allows for its slow waves."
    )
    return BalanceSection(_airspeed(results), residual)


def _airspeed(results: Results) -> str:
    air, scale = results.air, results.balance.airspeed_scale if results.balance else None
    if air.wind_mps is None or air.wind_from_deg is None:
        return "Without GPS neither wind nor the error of the airspeed is known."
    wind = f"Wind {air.wind_mps:.1f} m/s from {air.wind_from_deg:.0f} deg"
    if scale is None:
        return f"{wind}; airspeed is the velocity by GPS less the wind."
    return (
        f"{wind}. The airspeed in the log differs from the true one by {100 * scale.value:+.1f} %"
        f" ({100 * scale.lo:+.1f} to {100 * scale.hi:+.1f}), by GPS; corrected."
    )


def _date(results: Results) -> str:
    provenance = results.provenance
    if provenance is None or provenance.start_utc is None:
        return "Date not known"
    clock = "" if provenance.clock is Clock.SATELLITES else " (the computer's clock, which may be wrong)"
    return f"{provenance.start_utc.replace('T', ' ').removesuffix('Z')} UTC{clock}"


def _place(results: Results) -> str:
    provenance = results.provenance
    if provenance is None or provenance.latitude_deg is None or provenance.longitude_deg is None:
        return "place not known"
    north, east = "N" if provenance.latitude_deg >= 0 else "S", "E" if provenance.longitude_deg >= 0 else "W"
    height = "" if provenance.height_msl_m is None else f", {provenance.height_msl_m:.0f} m above sea level"
    return f"{abs(provenance.latitude_deg):.5f}° {north} {abs(provenance.longitude_deg):.5f}° {east}{height}"


def _wind(results: Results) -> str:
    air = results.air
    if air.wind_mps is None or air.wind_from_deg is None:
        return "not known"
    interval_text = "" if air.wind_standard_error_mps is None else f" ± {NORMAL_95 * air.wind_standard_error_mps:.1f}"
    return f"{air.wind_mps:.1f}{interval_text} m/s from {air.wind_from_deg:.0f}°"


def _length_of(air: AirFound) -> str:
    if air.gust_length == 1:
        return ""
    return f", {air.gust_length:.2f} times as long as MIL-F-8785C has them, by their spectra"


def temperature_text(air: AirFound) -> str:
    """Return text such as " (15 °C)"; empty if the temperature is not known."""
    return "" if air.temperature_K is None else f" ({air.temperature_K - 273.15:.0f} °C)"


def _air(results: Results) -> list[tuple[str, str]]:
    """Return what the flight shows about the air."""
    air, where = results.air, "runs" if results.runs else "flight"
    facts = []
    if air.wind_mps is not None:
        facts.append((f"Wind in the {where}", f"{_wind(results)}, found from airspeed and path"))
    if air.gust_mps is not None:
        gusts = f"{air.gust_mps:.2f} m/s vertical gusts (1 standard deviation){_length_of(air)}"
        facts.append(("Turbulence", gusts))
    if air.temperature_K is not None and air.pressure_Pa is not None and air.density_altitude_m is not None:
        state = f"{air.temperature_K - 273.15:.1f} °C, {air.pressure_Pa / 100:.0f} hPa"
        density = f"{results.test.air_density_kgpm3:.3f} kg/m³: density altitude {air.density_altitude_m:.0f} m"
        facts.append(("Air", f"{state}, {density}"))
    if air.lowest_height_m is not None:
        heights = f"{air.lowest_height_m:.0f} to {air.highest_height_m:.0f} m above the start"
        facts.append((f"Height of the {where}", heights))
    return facts


def _ticks(results: Results) -> str:
    log = results.provenance
    if log is None or log.ticks is None:
        return "the log has no record of it"
    return f"{log.ticks_missed} of {log.ticks + (log.ticks_missed or 0)} sampling instants were missed"
