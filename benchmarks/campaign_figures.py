"""Makes the tables of `benchmarks/campaigns.py` from the lines of its flights."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from campaign_draws import MORE_DRAG, Draws, with_more_drag
from estimators import OVER_STALL, speeds
from numpy.typing import NDArray
from records import Record, counted, markdown, rounded
from worlds import Points, world_records

from flightpower.analysis.curve import Polar, power_required
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.comparison import compare
from flightpower.analysis.flights.flight_statistics import read_statistics
from flightpower.analysis.flights.joint_pool import JointPool
from flightpower.analysis.flights.pool import joint_pool
from flightpower.analysis.flights.pooled import flights_to_see
from flightpower.flight.aircraft import load_aircraft

Array = NDArray[np.float64]
Flights = dict[int, dict[str, Any]]  # lines by the flight's number in its campaign
Cell = tuple[str, float, str]  # world, weather, configuration

NUMBERS, EACH = (1, 2, 5, 10, 20), (1, 2, 5, 10)
TO_SEE = MORE_DRAG


def by_campaign(lines: list[dict[str, Any]]) -> dict[Cell, dict[int, Flights]]:
    """Group analyzed flights by world, weather and configuration, then by campaign."""
    campaigns: dict[Cell, dict[int, Flights]] = {}
    for line in lines:
        if "results" in line:
            cell = campaigns.setdefault((line["world"], line["weather_kt"], line["configuration"]), {})
            cell.setdefault(line["campaign"], {})[line["flight"]] = line
    return campaigns


def print_figures(lines: list[dict[str, Any]], draws: int = 0) -> None:
    """Print Markdown tables: pools of each size, comparisons, and `draws` drawn campaigns."""
    flown = [line for line in lines if "results" in line]
    speeds_named = ", ".join(f"{x:g}" for x in OVER_STALL)
    print(f"{len(flown)} flights, {len(lines) - len(flown)} refused. Speeds: {speeds_named} times the stalling speed. %"
          " of the true power; half width: median.")  # fmt: skip
    campaigns = by_campaign(lines)
    for title, records in (
        ("Pools of flights of A", pools_records(campaigns)),
        ("Each flight of A alone", singles_records(campaigns)),
        ("B has 3 % more drag; alarms: A against A of the same campaign", comparison_records(campaigns)),
        ("C is B on another installation, whose files name that of A", false_name_records(campaigns)),
        (f"{draws} campaigns a row, drawn from the flights of A", drawn_records(flown, draws) if draws else []),
    ):
        if records:
            print(f"\n{title}.\n\n{markdown(records)}")


def groups(flights: Flights, size: int) -> Iterator[list[dict[str, Any]]]:
    """Yield disjoint groups of `size` flights."""
    numbers = sorted(flights)
    for first in range(0, len(numbers) - size + 1, size):
        yield [flights[number] for number in numbers[first : first + size]]


def pooled(lines: list[dict[str, Any]]) -> JointPool:
    return joint_pool([{"evidence": [], **line["results"]} for line in lines])


def errors(polar: Polar, pool: JointPool, lines: list[dict[str, Any]], V: Array) -> tuple[Array, Array]:
    """Return error and half the 95 % interval of a polar, each (speeds,), in percent of the true power."""
    truth = np.mean([line["power_W"] for line in lines], axis=0)
    power, error = power_required(V, polar, pool.condition)
    return 100 * (power / truth - 1), 100 * NORMAL_95 * error / truth


def mean_polar(pool: JointPool) -> Polar:
    """Return the mean of the flights' polars, with the covariance of a mean of independent estimates."""
    polars = [flight.polar for flight in pool.flights]
    weights = [np.linalg.inv(polar.covariance) for polar in polars]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    A = covariance @ np.sum([w @ polar.A for w, polar in zip(weights, polars, strict=True)], axis=0)
    return Polar(A, covariance)


def pools_records(campaigns: dict[Cell, dict[int, Flights]]) -> list[Record]:
    """Return records for each number of pooled flights; if too few were flown, with the predicted half width."""
    V, out = speeds(load_aircraft("nexstar")), []
    for (world, weather, configuration), campaign_lines in sorted(campaigns.items()):
        if configuration != "A":
            continue
        for number in NUMBERS:
            of_pool, of_mean, p = [], [], []
            for flights in campaign_lines.values():
                for lines in groups(flights, number):
                    pool = pooled(lines)
                    of_pool.append(errors(pool.polar, pool, lines, V))
                    of_mean.append(errors(mean_polar(pool), pool, lines, V))
                    p += [pool.homogeneity.p] if pool.homogeneity else []
            record: Record = {
                "world": world,
                "W20, kt": f"{weather:g}",
                "flights pooled": number,
                "pools": len(of_pool),
            }
            if of_pool:
                record |= _of_pools(of_pool, of_mean, p)
            else:
                promise = [promised(list(flights.values()), number, V) for flights in campaign_lines.values()]
                record |= {"pools": "promised", "half width": rounded(np.median(promise, axis=0), 1)}
            out.append(record)
    return out


def _of_pools(of_pool: list[tuple[Array, Array]], of_mean: list[tuple[Array, Array]], p: list[float]) -> Record:
    """Return half widths, errors and coverage of pools, and of weighted means of the same flights."""
    error, half = np.array(of_pool).transpose(1, 0, 2)
    mean_error, mean_half = np.array(of_mean).transpose(1, 0, 2)
    covered, counting = counted(np.mean(np.abs(error) < half, axis=1))
    return {
        "half width": rounded(np.median(half, axis=0), 1),
        "rms": rounded(_rms(error), 1),
        "coverage, %": rounded(covered),
        "±": rounded(counting, 1),
        "inhomogeneous, %": rounded(100 * np.mean(np.array(p) < 0.05)) if p else None,
        "weighted mean: rms": rounded(_rms(mean_error), 1),
        "its coverage, %": _covered(mean_error, mean_half),
    }


def singles_records(campaigns: dict[Cell, dict[int, Flights]]) -> list[Record]:
    """Return records of single flights of configuration A, by world."""
    V = speeds(load_aircraft("nexstar"))
    flights: dict[str, dict[float, list[Points]]] = {}
    for (world, weather, configuration), lines in sorted(campaigns.items()):
        if configuration == "A":
            pools = [(pooled([line]), [line]) for of_campaign in lines.values() for line in of_campaign.values()]
            flights.setdefault(world, {})[weather] = [errors(pool.polar, pool, line, V) for pool, line in pools]
    return world_records(flights)


def promised(lines: list[dict[str, Any]], number: int, V: Array) -> Array:
    """Return the half width (speeds,) [%] predicted for `number` flights, some of which are repeated."""
    pool = pooled(lines)
    return pool.half_widths_percent([len(range(i, number, len(lines))) for i in range(len(lines))], V)


def comparison_records(campaigns: dict[Cell, dict[int, Flights]]) -> list[Record]:
    """Compare A with B, and A with other A flights of the same campaign, between which there must be no difference."""
    out: list[Record] = []
    for (world, weather, configuration), lines in sorted(campaigns.items()):
        if configuration != "A":
            continue
        others = campaigns.get((world, weather, "B"), {})
        for each in EACH:
            seen, difference, half, alarms, to_see = [], [], [], [], []
            for campaign, flights in lines.items():
                own = [pooled(lines) for lines in groups(flights, each)]
                others_of = [pooled(lines) for lines in groups(others.get(campaign, {}), each)]
                for a, b in zip(own, others_of, strict=False):
                    comparison = compare(a, b)
                    seen.append(comparison.differs)
                    difference.append(comparison.difference_percent)
                    half.append(comparison.half_width_percent)
                    to_see.append(flights_to_see(a, TO_SEE) or np.inf)
                alarms += [compare(a, b).differs for a, b in zip(own[::2], own[1::2], strict=False)]
            if not seen and not alarms:
                continue
            record: Record = {"world": world, "W20, kt": f"{weather:g}", "flights each": each, "comparisons": len(seen)}
            if seen:
                record |= {
                    "seen, %": rounded(100 * np.mean(seen)),
                    "difference, %": rounded(np.mean(difference, axis=0), 1),
                    "half width": rounded(np.median(half, axis=0), 1),
                    "coverage, %": _covered(np.array(difference) - 100 * TO_SEE, np.array(half)),
                    "flights to see 3 %": rounded(np.median(to_see)),
                }
            alarmed = {"comparisons of A": len(alarms), "alarms, %": rounded(100 * np.mean(alarms)) if alarms else None}
            out.append(record | alarmed)
    return out


def false_name_records(campaigns: dict[Cell, dict[int, Flights]]) -> list[Record]:
    """Count how often comparisons and two-flight pools reject a false installation, and the evidence reports it.

    The flights have another installation, but their files name that of configuration A.
    """
    out: list[Record] = []
    for (world, weather, configuration), lines in sorted(campaigns.items()):
        others = campaigns.get((world, weather, "C"), {})
        for each in EACH:
            pairs = [
                pair
                for campaign in sorted(lines.keys() & others.keys())
                for pair in zip(groups(lines[campaign], each), groups(others[campaign], each), strict=False)
            ]
            if configuration != "A" or not pairs:
                continue
            compared = [compare(pooled(ours), pooled(of_other)) for ours, of_other in pairs]
            error = np.array([comparison.difference_percent for comparison in compared]) - 100 * TO_SEE
            half = np.array([comparison.half_width_percent for comparison in compared])
            pools = [pooled([ours[0], of_other[0]]) for ours, of_other in pairs]
            contradicted, named, remounted = (
                100 * np.mean(of_all)
                for of_all in (
                    [comparison.contradicted is not None for comparison in compared],
                    [bool(comparison.evidence()) for comparison in compared],
                    [bool(pool.remounted) for pool in pools],
                )
            )
            out.append({
                "world": world, "W20, kt": f"{weather:g}", "flights each": each, "comparisons": len(pairs),
                "denied, %": rounded(contradicted), "named, %": rounded(named), "coverage, %": _covered(error, half),
                "half width": rounded(np.median(half, axis=0), 1), "pools denied, %": rounded(remounted),
            })  # fmt: skip
    return out


def drawn_records(flown: list[dict[str, Any]], campaigns: int) -> list[Record]:
    """Return pools and comparisons of `campaigns` campaigns per row, drawn from the flights' statistics."""
    V, out = speeds(load_aircraft("nexstar")), []
    cells = sorted({(line["world"], line["weather_kt"]) for line in flown})
    for world, weather in cells:
        own = [
            line
            for line in flown
            if (line["world"], line["weather_kt"], line["configuration"]) == (world, weather, "A")
        ]
        statistics = [read_statistics(line["results"]) for line in own]
        polar = np.mean([flight.polar.A for flight in statistics], axis=0)
        condition = statistics[0].condition
        truth, _ = power_required(V, Polar(polar, np.zeros((3, 3))), condition)
        for number in NUMBERS:
            draws = Draws(statistics, polar, seed=number)
            of_pool, of_mean, p, seen, alarms = [], [], [], [], []
            for _ in range(campaigns):
                shared = draws.shared()
                pool = draws.pool(shared, number)
                for estimate, records in ((pool.polar, of_pool), (mean_polar(pool), of_mean)):
                    power, error = power_required(V, estimate, condition)
                    records.append((100 * (power / truth - 1), 100 * NORMAL_95 * error / truth))
                p += [pool.homogeneity.p] if pool.homogeneity else []
                alarms.append(compare(pool, draws.pool(shared, number)).differs)
                seen.append(compare(pool, draws.pool(with_more_drag(shared), number)).differs)
            of_comparisons = {"3 % more drag seen, %": rounded(100 * np.mean(seen)),
                              "alarms, %": rounded(100 * np.mean(alarms))}  # fmt: skip
            cell: Record = {"world": world, "W20, kt": f"{weather:g}", "flights pooled": number}
            out.append(cell | _of_pools(of_pool, of_mean, p) | of_comparisons)
    return out


def _rms(error: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def _covered(error: Array, half: Array) -> int:
    return round(float(100 * np.mean(np.abs(error) < half)))
