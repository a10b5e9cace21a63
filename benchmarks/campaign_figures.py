"""The tables of `benchmarks/campaigns.py`, from the lines of its flights."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from campaign_draws import MORE_DRAG, Draws, with_more_drag
from estimators import OVER_STALL, speeds
from numpy.typing import NDArray
from worlds import Points, world_table

from analysis.estimation.noise import NORMAL_95
from analysis.polar import Polar, power_required
from analysis.pooling.comparison import compare, flights_to_see
from analysis.pooling.flight_statistics import read_statistics
from analysis.pooling.pool import Pool, pool_results
from flight.aircraft import load_aircraft

Array = NDArray[np.float64]
Flights = dict[int, dict[str, Any]]  # lines by the number of the flight in its campaign
Cell = tuple[str, float, str]  # world, weather, configuration

NUMBERS, EACH = (1, 2, 5, 10, 20), (1, 2, 5, 10)
TO_SEE = MORE_DRAG


def print_figures(lines: list[dict[str, Any]], drawn: int = 0) -> None:
    """Markdown: pools of each size; comparisons; so many drawn campaigns."""
    flown = [line for line in lines if "results" in line]
    print(f"{len(flown)} flights, {len(lines) - len(flown)} refused.\n")
    campaigns: dict[Cell, dict[int, Flights]] = {}
    for line in flown:
        cell = campaigns.setdefault((line["world"], line["weather_kt"], line["configuration"]), {})
        cell.setdefault(line["campaign"], {})[line["flight"]] = line
    print("\n".join(pools_table(campaigns)), end="\n\n")
    print("\n".join(singles_table(campaigns)), end="\n\n")
    print("\n".join(comparisons_table(campaigns)), end="\n\n")
    print("\n".join(false_names_table(campaigns)), end="\n\n")
    if drawn:
        print("\n".join(drawn_table(flown, drawn)))


def groups(flights: Flights, size: int) -> Iterator[list[dict[str, Any]]]:
    """Flights in groups of this size, none in two groups."""
    numbers = sorted(flights)
    for first in range(0, len(numbers) - size + 1, size):
        yield [flights[number] for number in numbers[first : first + size]]


def pooled(lines: list[dict[str, Any]]) -> Pool:
    return pool_results([{"evidence": [], **line["results"]} for line in lines])


def errors(found: Polar, pool: Pool, lines: list[dict[str, Any]], V: Array) -> tuple[Array, Array]:
    """Error and half the 95 % interval of a polar, each (speeds,), in percent of the true power."""
    truth = np.mean([line["power_W"] for line in lines], axis=0)
    power, error = power_required(V, found, pool.condition)
    return 100 * (power / truth - 1), 100 * NORMAL_95 * error / truth


def mean_polar(pool: Pool) -> Polar:
    """The mean of the flights' polars, with the covariance of a mean of independent estimates."""
    polars = [Polar(flight.values[:3], flight.polar_covariance) for flight in pool.flights]
    weights = [np.linalg.inv(polar.covariance) for polar in polars]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    A = covariance @ np.sum([w @ polar.A for w, polar in zip(weights, polars, strict=True)], axis=0)
    return Polar(A, covariance)


def pools_table(campaigns: dict[Cell, dict[int, Flights]]) -> list[str]:
    V = speeds(load_aircraft("nexstar"))
    names = " / ".join(f"{x:g}" for x in OVER_STALL)
    out = [
        f"Speeds: {names} times the stalling speed. Half width: median; rms of errors; coverage of the 95 % interval"
        " over all speeds; % of the true power. Promised: half width where statistics of a flight are used several"
        " times.",
        "",
        "| world | W20, kt | flights pooled | pools | half width | rms | coverage, % | inhomogeneous, %"
        " | weighted mean: rms | its coverage, % |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for (world, weather, configuration), found in sorted(campaigns.items()):
        if configuration != "A":
            continue
        for number in NUMBERS:
            of_pool, of_mean, p = [], [], []
            for flights in found.values():
                for lines in groups(flights, number):
                    pool = pooled(lines)
                    of_pool.append(errors(pool.polar, pool, lines, V))
                    of_mean.append(errors(mean_polar(pool), pool, lines, V))
                    p += [pool.homogeneity.p] if pool.homogeneity else []
            head = f"| {world} | {weather:g} | {number} |"
            if not of_pool:
                promise = [promised(list(flights.values()), number, V) for flights in found.values()]
                out.append(f"{head} promised | {_listed(np.median(promise, axis=0))} | - | - | - | - | - |")
                continue
            (error, half), (mean_error, mean_half) = (
                np.array(of_pool).transpose(1, 0, 2),
                np.array(of_mean).transpose(1, 0, 2),
            )
            alarms = f"{100 * np.mean(np.array(p) < 0.05):.0f}" if p else "-"
            out.append(
                f"{head} {len(error)} | {_listed(np.median(half, axis=0))} | {_listed(_rms(error))}"
                f" | {_covered(error, half)} | {alarms} | {_listed(_rms(mean_error))}"
                f" | {_covered(mean_error, mean_half)} |"
            )
    return out


def singles_table(campaigns: dict[Cell, dict[int, Flights]]) -> list[str]:
    """Each flight of A alone, by world."""
    V = speeds(load_aircraft("nexstar"))
    flights: dict[str, dict[float, list[Points]]] = {}
    for (world, weather, configuration), found in sorted(campaigns.items()):
        if configuration == "A":
            pools = [(pooled([line]), [line]) for of_campaign in found.values() for line in of_campaign.values()]
            flights.setdefault(world, {})[weather] = [errors(pool.polar, pool, line, V) for pool, line in pools]
    return world_table(flights)


def promised(lines: list[dict[str, Any]], number: int, V: Array) -> Array:
    """Half width (speeds,) [%] that so many flights promise, of which some are the same."""
    pool = pooled(lines)
    return pool.half_widths_percent([len(range(i, number, len(lines))) for i in range(len(lines))], V)


def comparisons_table(campaigns: dict[Cell, dict[int, Flights]]) -> list[str]:
    out = [
        "Configuration B has 3 % more drag. Alarms: flights of A against others of A of the same campaign.",
        "",
        "| world | W20, kt | flights each | comparisons | seen, % | difference at the speeds, % | half width"
        " | coverage, % | comparisons of A | alarms, % | flights to see 3 % |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for (world, weather, configuration), found in sorted(campaigns.items()):
        if configuration != "A":
            continue
        others = campaigns.get((world, weather, "B"), {})
        for each in EACH:
            seen, difference, half, alarms, to_see = [], [], [], [], []
            for campaign, flights in found.items():
                own = [pooled(lines) for lines in groups(flights, each)]
                others_of = [pooled(lines) for lines in groups(others.get(campaign, {}), each)]
                for a, b in zip(own, others_of, strict=False):
                    comparison = compare(a, b)
                    seen.append(comparison.differs)
                    difference.append(comparison.difference_percent)
                    half.append(comparison.half_width_percent)
                    to_see.append(flights_to_see(a, TO_SEE) or np.inf)
                alarms += [compare(a, b).differs for a, b in zip(own[::2], own[1::2], strict=False)]
            alarmed = f"{len(alarms)} | {100 * np.mean(alarms):.0f}" if alarms else "0 | -"
            if not seen and not alarms:
                continue
            text = "0 | - | - | - | -"
            if seen:
                error, width = np.array(difference) - 100 * TO_SEE, np.array(half)
                text = (
                    f"{len(seen)} | {100 * np.mean(seen):.0f} | {_listed(np.mean(difference, axis=0))}"
                    f" | {_listed(np.median(half, axis=0))} | {_covered(error, width)}"
                )
            wanted = f"{np.median(to_see):.0f}" if to_see else "-"
            out.append(f"| {world} | {weather:g} | {each} | {text} | {alarmed} | {wanted} |")
    return out


def false_names_table(campaigns: dict[Cell, dict[int, Flights]]) -> list[str]:
    """Flights of another installation, whose files name that of A."""
    out = [
        "Configuration C is B on another installation, whose files name that of A. Denied: comparisons, and pools of"
        " one flight of each, that do not believe it; named: those of which evidence says so.",
        "",
        "| world | W20, kt | flights each | comparisons | denied, named, % | coverage, % | half width"
        " | pools denied, % |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (world, weather, configuration), found in sorted(campaigns.items()):
        others = campaigns.get((world, weather, "C"), {})
        for each in EACH:
            pairs = [
                pair
                for campaign in sorted(found.keys() & others.keys())
                for pair in zip(groups(found[campaign], each), groups(others[campaign], each), strict=False)
            ]
            if configuration != "A" or not pairs:
                continue
            compared = [compare(pooled(ours), pooled(theirs)) for ours, theirs in pairs]
            error = np.array([one.difference_percent for one in compared]) - 100 * TO_SEE
            half = np.array([one.half_width_percent for one in compared])
            pools = [pooled([ours[0], theirs[0]]) for ours, theirs in pairs]
            denied, named, anew = (
                100 * np.mean(of_all)
                for of_all in (
                    [one.denied is not None for one in compared],
                    [bool(one.evidence()) for one in compared],
                    [bool(pool.anew) for pool in pools],
                )
            )
            out.append(
                f"| {world} | {weather:g} | {each} | {len(pairs)} | {denied:.0f}, {named:.0f} | {_covered(error, half)}"
                f" | {_listed(np.median(half, axis=0))} | {anew:.0f} |"
            )
    return out


def drawn_table(flown: list[dict[str, Any]], campaigns: int) -> list[str]:
    """Pools and comparisons of so many campaigns a row, drawn from the flights' statistics."""
    V = speeds(load_aircraft("nexstar"))
    out = [
        f"{campaigns} campaigns a row, drawn from the statistics of the flights of A (`benchmarks/campaign_draws.py`).",
        "",
        "| world | W20, kt | flights | half width | rms | coverage, % | inhomogeneous, % | mean: rms | its coverage, %"
        " | 3 % more drag seen, % | alarms, % |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    cells = sorted({(line["world"], line["weather_kt"]) for line in flown})
    for world, weather in cells:
        own = [
            line
            for line in flown
            if (line["world"], line["weather_kt"], line["configuration"]) == (world, weather, "A")
        ]
        statistics = [read_statistics(line["results"]) for line in own]
        polar = np.mean([flight.values[:3] for flight in statistics], axis=0)
        condition = statistics[0].condition
        truth, _ = power_required(V, Polar(polar, np.zeros((3, 3))), condition)
        for number in NUMBERS:
            draws = Draws(statistics, polar, seed=number)
            of_pool, of_mean, p, seen, alarms = [], [], [], [], []
            for _ in range(campaigns):
                shared = draws.shared()
                pool = draws.pool(shared, number)
                for found, kept in ((pool.polar, of_pool), (mean_polar(pool), of_mean)):
                    power, error = power_required(V, found, condition)
                    kept.append((100 * (power / truth - 1), 100 * NORMAL_95 * error / truth))
                p += [pool.homogeneity.p] if pool.homogeneity else []
                alarms.append(compare(pool, draws.pool(shared, number)).differs)
                seen.append(compare(pool, draws.pool(with_more_drag(shared), number)).differs)
            error, half = np.array(of_pool).transpose(1, 0, 2)
            mean_error, mean_half = np.array(of_mean).transpose(1, 0, 2)
            inhomogeneous = f"{100 * np.mean(np.array(p) < 0.05):.0f}" if p else "-"
            out.append(
                f"| {world} | {weather:g} | {number} | {_listed(np.median(half, axis=0))} | {_listed(_rms(error))}"
                f" | {_covered(error, half)} | {inhomogeneous} | {_listed(_rms(mean_error))}"
                f" | {_covered(mean_error, mean_half)} | {100 * np.mean(seen):.0f} | {100 * np.mean(alarms):.0f} |"
            )
    return out


def _rms(error: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def _covered(error: Array, half: Array) -> str:
    return f"{100 * np.mean(np.abs(error) < half):.0f}"


def _listed(values: Array) -> str:
    return " / ".join(f"{x:.1f}" for x in values)
