"""Pools of electrical curves: own errors average out; shared errors stay, but cancel between pools of one aircraft."""

import json
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
import pytest
from synthetic_flights import flight as synthetic_flight
from synthetic_flights import truth
from typer.testing import CliRunner

from flightpower.analysis.cli.compare import app as compare_command
from flightpower.analysis.cli.several_logs import _pool
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.campaign.campaign import Campaign
from flightpower.analysis.flights.comparison import Comparison, compare
from flightpower.analysis.flights.curve_pool import CurvePool
from flightpower.analysis.flights.evidence import NOT_ONE_VEHICLE
from flightpower.analysis.flights.pool import pool_results
from flightpower.analysis.flights.pooled import Pool, flights_to_see
from flightpower.analysis.pages.pooled_page import comparison_answers, render_comparison, render_pooled
from flightpower.analysis.performance.other_weights import NO_BATTERY, electrical_at_weights
from flightpower.analysis.performance.request import Request
from flightpower.analysis.records.flight import POWER_FORMAT, BatteryResult, EvidenceKind, Kind, Results, Trust
from flightpower.analysis.records.pool import POOLED_FORMAT, LeftOutReason
from flightpower.analysis.results.read import read_results
from flightpower.flight.command_line import ExitCode
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2

V = np.linspace(12.0, 20.0, 13)
IDLE_W, OWN, SHARED = 4.0, 0.03, 0.02
TRUTH = truth(np.random.default_rng(5))  # polar, thrust and installation of the flights with drag
WEIGHT_N, RHO = 38.0, 1.2


def power_of(V: np.ndarray, weight_N: float = WEIGHT_N, rho: float = RHO, drag: float = 1.0) -> np.ndarray:
    """Power of a parabolic polar at an efficiency that falls as C_L rises, and so depends on J / c_P^(1/3)."""
    CL = weight_N / (rho / 2 * V**2 * 0.46)
    return IDLE_W + rho / 2 * V**3 * 0.46 * drag * (0.04 + 0.05 * CL**2) / (0.6 - 0.1 * CL)


def flight(log: str = "a", error: np.ndarray | float = 0.0, **of) -> Results:
    """Own errors are a share OWN of power, correlated over 3 m/s; `shared` is a share of power at all speeds."""
    name, drag = of.pop("name", "A"), of.pop("drag", 1.0)
    weight_N, rho, speeds = of.pop("weight_N", WEIGHT_N), of.pop("rho", RHO), of.pop("speeds", V)
    truth = power_of(speeds, weight_N, rho, drag)
    power = truth * (1 + error)
    own = OWN**2 * np.outer(truth, truth) * np.exp(-(((speeds[:, None] - speeds) / 3.0) ** 2))
    condition = {"weight_N": weight_N, "air_density_kgpm3": rho}
    statistics = {
        "format": POWER_FORMAT, "speed_mps": speeds.tolist(), "power_W": power.tolist(),
        "own_covariance": own.tolist(), "shared": {"current": (SHARED * truth).tolist()},
    }  # fmt: skip
    points = [
        {"speed_mps": v, "power_W": p, "power_lo_W": 0.9 * p, "power_hi_W": 1.1 * p}
        for v, p in zip(speeds.tolist(), power.tolist(), strict=True)
    ]
    content = {
        "log": log, "software_version": "0", "kind": Kind.ELECTRICAL, "test": condition,
        "aircraft": {"name": name, "title": name, "wing_area_m2": 0.46, "span_m": 1.75, "propeller": ""},
        "vehicle": of.pop("vehicle", ""),
        "curves": {
            Kind.ELECTRICAL: {
                "condition": condition, "points": points, "idle_power_W": IDLE_W, "statistics": statistics,
            }
        },
    }  # fmt: skip
    return msgspec.convert(content, Results)


def flights_with_errors(rng: np.random.Generator, count: int, common: float | None = None, **of) -> list[Results]:
    """Flights of one aircraft, whose shared error is drawn once."""
    shape = np.exp(-(((V[:, None] - V) / 3.0) ** 2))
    shared = SHARED * rng.standard_normal() if common is None else common
    errors = rng.multivariate_normal(np.zeros(len(V)), OWN**2 * shape, count, method="eigh") + shared
    return [flight(f"{i}", error, **of) for i, error in enumerate(errors)]


def electrical_pool(flights: Sequence[Results]) -> CurvePool:
    pool = pool_results(flights)
    assert isinstance(pool, CurvePool)
    return pool


def compared(a: Sequence[Results], b: Sequence[Results]) -> Comparison:
    return compare(pool_results(a), pool_results(b))


def half_shares(flights: Sequence[Results]) -> np.ndarray:
    pool = electrical_pool(flights)
    return np.sqrt(np.diag(pool.curve.power_W.covariance)) / pool.curve.power_W.value


def test_one_flight_is_its_own_pool() -> None:
    pool = electrical_pool([flight(error=0.1)])
    assert pool.curve.power_W.value == pytest.approx(1.1 * power_of(pool.curve.V_mps), rel=1e-4)
    assert half_shares([flight()]) == pytest.approx(np.hypot(OWN, SHARED), rel=1e-3)
    result = pool.results()
    assert result.homogeneity is None and result.flights[0].p is None and not result.flights[0].outlier


def test_a_flight_with_runs_is_pooled_by_its_electrical_power_with_an_autopilot_s() -> None:
    """Both powers are of one aircraft in flight; the drag of its one flight is kept as the other kind of power."""
    autopilot, other = flight("a", 0.02), flight("b", -0.02)
    mixed, alike = electrical_pool([autopilot, with_drag(other)]), electrical_pool([autopilot, other])
    np.testing.assert_array_equal(mixed.curve.power_W.value, alike.curve.power_W.value)
    assert mixed.kind is Kind.ELECTRICAL and [flight.name for flight in mixed.flights] == ["a", "b"]
    assert logs_of(mixed.other_kind) == ["b"]


def with_drag(results: Results, *, battery: bool = True, seed: int = 5, **facts: str) -> Results:
    """The flight with drag statistics added, like a flight of our tray; without a battery it has only drag."""
    rng = np.random.default_rng(seed)
    by_runs = read_results(synthetic_flight(TRUTH, rng, results.log, **facts))
    curves = {**by_runs.curves, **(results.curves if battery else {})}
    return msgspec.structs.replace(by_runs, curves=curves, aircraft=results.aircraft, log=results.log)


def logs_of(pool: Pool | None) -> list[str]:
    assert pool is not None
    return [flight.name for flight in pool.flights]


def of_tray(*logs: str, battery: bool = True) -> list[Results]:
    """Flights with drag, each with errors of its own."""
    return [with_drag(flight(log, 1e-4 * ord(log)), battery=battery, seed=ord(log)) for log in logs]


def test_one_more_flight_costs_a_pool_of_drag_nothing() -> None:
    """The curve of five flights with drag is unchanged to the last digit; electrical power of all six is added."""
    five, autopilot = of_tray(*"bcdef"), flight("a", 0.02)
    alone, mixed = pool_results(five), pool_results([autopilot, *five])
    assert alone.other_kind is None and mixed.kind is Kind.POWER_REQUIRED
    for of_five, before in zip(mixed.power(alone.speeds_mps), alone.power(alone.speeds_mps), strict=True):
        np.testing.assert_array_equal(of_five, before)
    assert logs_of(mixed) == [*"bcdef"] and logs_of(mixed.other_kind) == [*"abcdef"]
    assert [(flight.log, flight.reason) for flight in mixed.left_out] == [("a", LeftOutReason.ELECTRICAL_ONLY)]
    four = pool_results([autopilot, *five[:3]]).other_kind
    assert four is not None and mixed.other_kind is not None
    middle = len(V) // 2
    assert (mixed.other_kind.power(V)[1] / mixed.other_kind.power(V)[0])[middle] < (
        four.power(V)[1] / four.power(V)[0]
    )[middle]


def test_no_sequence_of_flights_makes_a_pool_lose_a_flight_that_it_had() -> None:
    """This holds for either kind of power, in any order, and with another aircraft's flight, which one kind refuses."""
    small = msgspec.structs.replace(flight().aircraft, span_m=1.0)
    flights = [*of_tray("b", "c"), *of_tray("d", battery=False), flight("x", 0.02), flight("y", 0.03)]
    stranger = msgspec.structs.replace(flight("z", 0.01), aircraft=small)
    for seed in range(6):
        order = [flights[i] for i in np.random.default_rng(seed).permutation(len(flights))]
        before: set[tuple[Kind, str]] = set()
        for n in range(1, len(order) + 1):
            pool = pool_results(order[:n])
            pools = [pool, *([pool.other_kind] if pool.other_kind else [])]
            now = {(part.kind, log) for part in pools for log in logs_of(part)}
            assert before <= now
            assert {log for _, log in now} == {item.log for item in order[:n]}
            before = now
        with_stranger = pool_results([*order, stranger])
        assert with_stranger.kind is Kind.POWER_REQUIRED and logs_of(with_stranger) == logs_of(pool)
        assert "Electrical power gives no estimate here: two aircraft in one pool" in with_stranger.results().notes[-1]


def test_flights_without_a_battery_and_an_autopilot_s_have_a_pool_each() -> None:
    autopilot, no_battery = flight("a", 0.02), of_tray("b", battery=False)
    pool = pool_results([autopilot, *no_battery])
    assert pool.kind is Kind.ELECTRICAL and logs_of(pool) == ["a"] and logs_of(pool.other_kind) == ["b"]
    (left_out,) = pool.left_out
    assert (left_out.log, left_out.reason) == ("b", LeftOutReason.NO_BATTERY) and "no battery" in left_out.text
    neither = msgspec.structs.replace(flight("n"), curves={}, kind=Kind.POWER_REQUIRED)
    assert [flight.reason for flight in pool_results([autopilot, neither]).left_out] == [LeftOutReason.NO_STATISTICS]
    with pytest.raises(InputError, match="results of n: no statistics for pooling"):
        pool_results([neither])


def test_drag_that_cannot_be_pooled_leaves_electrical_power_with_the_reason() -> None:
    autopilot = flight("a", 0.02)
    b, c = with_drag(flight("b")), with_drag(flight("c", 0.01), seed=6, installation="another")
    with pytest.raises(InputError, match="two installations in one pool"):
        pool_results([b, c])
    pool = pool_results([autopilot, b, c])
    assert pool.kind is Kind.ELECTRICAL and logs_of(pool) == ["a", "b", "c"] and pool.other_kind is None
    assert "Power required gives no estimate here: two installations in one pool: b has" in pool.results().notes[-1]


def test_pools_are_compared_by_the_kinds_of_power_that_both_have() -> None:
    """The power of the autopilot's flight is 10 % above that of the others."""
    (*tray, f, g), autopilot = of_tray(*"bcdfg"), flight("a", 0.1)
    electrical = compared(tray, [autopilot]).results()
    assert electrical.kind is Kind.ELECTRICAL and electrical.other_kind is None and electrical.a.logs == [*"bcd"]
    assert "Power required gives no estimate here: no flight of B gives power required" in electrical.notes[-1]
    both = compared(tray, [f, g, autopilot]).results()
    assert both.kind is Kind.POWER_REQUIRED and both.b.logs == ["f", "g"] and both.other_kind is not None
    assert (both.other_kind.kind, both.other_kind.b.logs) == (Kind.ELECTRICAL, ["f", "g", "a"])
    assert [flight.log for flight in both.b.left_out] == ["a"] and "the electrical power of B" in both.other_kind.text
    page = render_comparison(both)
    assert "<h1> against : power required</h1>" in page and "<h2> against : electrical power</h2>" in page
    with pytest.raises(InputError, match="no flight of A gives electrical power; add one to compare by it"):
        compared(of_tray("b", battery=False), [autopilot])
    with pytest.raises(InputError, match="a is in both pools"):
        compared([autopilot], [autopilot])


def test_answer_and_sentence_quote_one_difference() -> None:
    """They agree even if, without a difference, some interval excludes zero by chance and the test finds nothing."""
    rng, by_chance = np.random.default_rng(12), 0
    for _ in range(12):
        result = compared(flights_with_errors(rng, 2, 0.0), flights_with_errors(rng, 2, 0.0)).results()
        answer = comparison_answers(result)[1]
        speed_text = f"{result.quoted.speed_mps:.1f} m/s"
        assert (
            f"at {speed_text}" in result.text
            and f"at {speed_text}" in answer.note
            and result.quoted in result.differences
        )
        assert result.quoted.excludes_zero is any(row.excludes_zero for row in result.differences)
        assert answer.question.startswith("Clearest" if result.quoted.excludes_zero else "Difference where it is known")
        by_chance += result.quoted.excludes_zero and not result.differs
        assert ("errors alone" in result.text) is (result.quoted.excludes_zero and not result.differs)
    assert by_chance >= 1


def folders_of(folder: Path, flights: Sequence[Results]) -> list[Path]:
    folders = [folder / this_flight.log for this_flight in flights]
    for this_folder, this_flight in zip(folders, flights, strict=True):
        this_folder.mkdir(parents=True)
        (this_folder / "results.json").write_bytes(msgspec.json.encode(this_flight))
    return folders


def test_the_commands_give_both_kinds_as_python_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sides = {"a": [*of_tray("b", "c"), flight("x", 0.02)], "b": [flight("autopilot", 0.1)]}
    for side, flights in sides.items():
        folders = folders_of(tmp_path / side, flights)
        assert _pool(Campaign(folders=folders), tmp_path / side, quiet=False) is ExitCode.DONE
    printed = capsys.readouterr().out
    assert "A: power required" in printed and "flights: 2 pooled, 1 left out" in printed
    assert "A: electrical power" in printed and "flights: 3 pooled, 0 left out" in printed
    assert "note: left out: x: it gives electrical power only" in printed
    pooled = json.loads((tmp_path / "a" / "results.json").read_text())
    assert (pooled["kind"], pooled["other_kind"]["kind"]) == (Kind.POWER_REQUIRED, Kind.ELECTRICAL)
    assert pooled["left_out"] == [
        {"log": "x", "reason": "electrical power only", "text": "it gives electrical power only"}
    ]
    in_python = pool_results(sides["a"]).results()
    assert pooled["other_kind"] == msgspec.to_builtins(in_python.other_kind)
    page = (tmp_path / "a" / "report.html").read_text()
    assert "<h2>A: electrical power, 3 flights</h2>" in page and page.count('id="power"') == 1
    assert page.count('id="other-power"') == 1
    words = [str(tmp_path / "a"), str(tmp_path / "b"), "-o", str(tmp_path / "c")]
    outcome = CliRunner().invoke(compare_command, words)
    content = json.loads((tmp_path / "c" / "results.json").read_text())
    kg = in_python.other_kind.test.weight_N / GRAVITY_MPS2  # type: ignore[union-attr]
    assert outcome.exit_code == ExitCode.DONE
    assert f"A: a, B: b, by electrical power, both at {kg:.2f} kg" in " ".join(outcome.output.split())
    assert content["a"]["logs"] == ["b", "c", "x"], "including those of the pool's second estimate"
    index = np.argmin([row["independent_half_width_percent"] for row in content["differences"]])
    assert content["differences"][index]["difference_percent"] == pytest.approx(8.0, abs=1.5)


def test_a_pool_knows_endurance_by_the_battery_of_its_flights() -> None:
    battery = BatteryResult(energy_Wh=100.0, usable=0.8)
    pooled = electrical_pool([msgspec.structs.replace(flight("a"), battery=battery), flight("b", 0.01)]).results()
    least_W = min(point.power_W for point in pooled.main.points)
    assert pooled.main.endurance_s is not None
    assert pooled.main.endurance_s.value == pytest.approx(3600 * 80.0 / least_W)


def test_a_pool_answers_other_weights() -> None:
    """At equal lift coefficients speed goes with the root of the weight, motor power with its 1.5th power."""
    pool = electrical_pool([flight("a"), flight("b", 0.01)])
    request = Request(weights_N=(1.44 * WEIGHT_N,))
    battery = BatteryResult(energy_Wh=100.0, usable=0.8)
    (without,) = electrical_at_weights(pool.curve, request.weights_N, None)
    least = int(np.argmin(pool.curve.power_W.value))
    power_W = IDLE_W + 1.44**1.5 * (pool.curve.power_W.value[least] - IDLE_W)
    assert f"With {1.44 * WEIGHT_N / 9.80665:.2f} kg: least power {power_W:.0f} W (" in without
    assert f"at {1.2 * pool.curve.V_mps[least]:.1f} m/s" in without and " min" not in without
    assert pool.results(request=request).notes == [without] and pool.results().notes == []
    (with_battery,) = electrical_at_weights(pool.curve, request.weights_N, battery)
    assert f", {80 * 60 / power_W:.0f} min (" in with_battery and " km (" in with_battery
    assert "times the weight flown" in pool.results(request=Request(weights_N=(4 * WEIGHT_N,))).notes[-1]


def test_a_pool_of_drag_without_a_battery_says_what_other_weights_require() -> None:
    rng = np.random.default_rng(3)
    pool = pool_results([synthetic_flight(truth(rng), rng, name) for name in "ab"])
    notes = pool.results(request=Request(weights_N=(WEIGHT_N,))).notes
    assert [note for note in notes if note not in pool.results().notes] == [NO_BATTERY]


def test_one_more_flight_and_a_difference_to_see_follow_from_own_errors() -> None:
    """Three flights have errors of 3 % each: a fourth gives 3 %/sqrt(4), and a change of 2 % takes so many flights that
    its test at three speeds has the required power; shared errors do not count."""
    pool = electrical_pool([flight(str(i), 1e-6 * i) for i in range(3)])
    V = pool.speeds_mps
    own = [NORMAL_95 * 100 * np.hypot(OWN / np.sqrt(n), SHARED) for n in (3, 4)]
    assert pool.half_widths_percent([1, 1, 1], V) == pytest.approx(own[0], rel=1e-3)
    assert pool.half_widths_percent([2, 1, 1], V) == pytest.approx(own[1], rel=1e-3)
    few, many = (flights_to_see(pool, share) for share in (0.05, 0.02))
    assert few is not None and many is not None and many == pytest.approx(6.25 * few, abs=6.25)


def test_own_errors_fall_with_the_number_of_flights_and_shared_ones_stay() -> None:
    flights = [flight(str(i), 1e-6 * i) for i in range(9)]
    assert half_shares(flights) == pytest.approx(np.hypot(OWN / 3, SHARED), rel=1e-3)


@pytest.mark.parametrize("count", [3, *(pytest.param(count, marks=pytest.mark.thorough) for count in (1, 10))])
def test_pools_contain_the_truth_as_often_as_they_say(count: int) -> None:
    rng, inside = np.random.default_rng(count), []
    for _ in range(300):
        pool = electrical_pool(flights_with_errors(rng, count))
        half = NORMAL_95 * np.sqrt(np.diag(pool.curve.power_W.covariance))
        inside.append(np.abs(pool.curve.power_W.value - power_of(pool.curve.V_mps)) < half)
    assert 0.92 < np.mean(inside) < 0.98


def test_a_flight_that_begins_amid_the_curve_makes_no_step_in_it() -> None:
    """Power rises from 13 m/s on, but the plain mean falls at 14 m/s, where the flight with less power begins."""
    pool = electrical_pool([flight("a", 0.03), flight("b", -0.03, speeds=V[V > 13.9])])
    speeds = pool.curve.V_mps
    rising = speeds > 13.0
    assert np.diff(power_of(speeds)[rising]).min() > 0 and np.diff(pool.mean(speeds).value[rising]).min() < -1.0
    assert np.diff(pool.curve.power_W.value[rising]).min() > 0
    half = 100 * pool.curve.power_W.half_width / pool.curve.power_W.value
    assert pool.half_widths_percent([1, 1], speeds) == pytest.approx(half), "the page's table and figures agree"
    alike = electrical_pool([flight("a"), flight("b", speeds=V[V > 13.9])])
    assert alike.curve.power_W.value == pytest.approx(power_of(alike.curve.V_mps), rel=2e-4)


def test_pools_of_flights_over_different_speeds_contain_the_truth_as_often_as_they_say() -> None:
    rng, inside = np.random.default_rng(7), []
    shape = np.exp(-(((V[:, None] - V) / 3.0) ** 2))
    for _ in range(150):
        errors = rng.multivariate_normal(np.zeros(len(V)), OWN**2 * shape, 3, method="eigh")
        errors += SHARED * rng.standard_normal()
        begins = [0, *rng.integers(0, 6, 2)]
        flights = [
            flight(f"{i}", error[begin:], speeds=V[begin:])
            for i, (error, begin) in enumerate(zip(errors, begins, strict=True))
        ]
        curve = electrical_pool(flights).curve
        inside.append(np.abs(curve.power_W.value - power_of(curve.V_mps)) < NORMAL_95 * curve.power_W.standard_error)
    assert 0.91 < np.mean(inside) < 0.985  # 150 draws of some four independent speeds each: 0.95 within 0.03


def test_curves_meet_at_one_weight_and_density() -> None:
    """A heavy flight in thin air and a light one in dense air have the same curve at their mean weight and density."""
    slow, fast = V * np.sqrt(0.9 * RHO / 1.25), V * np.sqrt(1.1 * RHO / 1.15)
    flights = [flight("a", weight_N=0.9 * WEIGHT_N, rho=1.25, speeds=slow),
               flight("b", weight_N=1.1 * WEIGHT_N, rho=1.15, speeds=fast)]  # fmt: skip
    pool = electrical_pool(flights)
    assert (pool.curve.condition.weight_N, pool.curve.condition.rho) == pytest.approx((WEIGHT_N, 1.2))
    assert pool.curve.power_W.value == pytest.approx(power_of(pool.curve.V_mps), rel=1e-4)


@pytest.mark.thorough
def test_a_change_of_drag_is_seen_because_shared_errors_cancel() -> None:
    """The change is 8 %, with five flights each; equal configurations are found different in about 5 % of
    comparisons."""
    rng = np.random.default_rng(7)
    seen, false, inside = [], [], []
    for _ in range(100):
        common = SHARED * rng.standard_normal()
        a, b, c = (flights_with_errors(rng, 5, common, drag=drag) for drag in (1.0, 1.0, 1.08))
        changed = compared(a, c).results("old", "new")
        seen.append(changed.differs)
        false.append(compared(a, b).differs)
        inside += [row.lo_percent < 100 * (power_of(row.speed_mps, drag=1.08) / power_of(row.speed_mps) - 1)
                   < row.hi_percent for row in changed.differences]  # fmt: skip
    assert np.mean(seen) > 0.9 and np.mean(false) < 0.1 and 0.91 < np.mean(inside) <= 1.0
    assert changed.a.name == "old" and changed.same_installation
    another = msgspec.structs.replace(flight().aircraft, title="B")
    other = compared(a, [msgspec.structs.replace(item, aircraft=another) for item in c]).results()
    widths = [[row.hi_percent - row.lo_percent for row in result.differences] for result in (changed, other)]
    assert not other.same_installation and (np.array(widths[1]) > 1.2 * np.array(widths[0])).all()
    assert widths[1] == pytest.approx([2 * row.independent_half_width_percent for row in changed.differences])


def test_a_flight_that_differs_is_an_outlier() -> None:
    flights = [flight(str(i), 1e-6 * i) for i in range(4)] + [flight("wrong", 0.2)]
    result = electrical_pool(flights).results(["y: torn"])
    assert [flight.log for flight in result.flights if flight.outlier] == ["wrong"]
    assert result.homogeneity is not None and result.homogeneity.p < 1e-3
    assert result.trust is Trust.DOUBTFUL and {evidence.kind for evidence in result.evidence} == {
        EvidenceKind.FLIGHTS_DIFFER
    }
    assert compared(flights, [flight("b", 1e-5)]).results().trust is Trust.DOUBTFUL
    assert result.left_out == [] and result.failures == ["y: torn"]
    pair = electrical_pool(flights[-2:]).results()
    assert not any(flight.outlier for flight in pair.flights), "with two flights it is unknown which is wrong"


def test_the_commands_pool_and_compare_as_those_of_drag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`analyze LOG LOG` and `analyze compare` start from the flights' folders."""
    rng = np.random.default_rng(3)
    folders = {name: [] for name in ("old", "new")}
    for name, drag in (("old", 1.0), ("new", 1.3)):
        for item in flights_with_errors(rng, 3, 0.0, drag=drag):
            folder = tmp_path / name / item.log
            folder.mkdir(parents=True)
            (folder / "results.json").write_bytes(msgspec.json.encode(item))
            folders[name].append(folder)
        campaign = Campaign(folders=folders[name], failures=["x.ulg: torn"])
        assert _pool(campaign, tmp_path / name, quiet=False) == ExitCode.DONE
        assert "3 pooled, 0 left out, 1 refused" in capsys.readouterr().out
        pooled = json.loads((tmp_path / name / "results.json").read_text("utf-8"))
        assert pooled["format"] == POOLED_FORMAT and len(pooled["flights"]) == 3
        assert (tmp_path / name / "report.html").stat().st_size > 1000
    words = [str(tmp_path / "old"), str(tmp_path / "new"), "-o", str(tmp_path / "difference")]
    assert CliRunner().invoke(compare_command, words).exit_code == ExitCode.DONE
    content = json.loads((tmp_path / "difference" / "results.json").read_text("utf-8"))
    assert content["differs"] and content["a"]["logs"] == ["0", "1", "2"]


def test_what_is_not_pooled_is_reported() -> None:
    small = msgspec.structs.replace(flight().aircraft, span_m=1.0)
    with pytest.raises(InputError, match="two aircraft"):
        electrical_pool([flight("a"), msgspec.structs.replace(flight("b", 0.01), aircraft=small)])
    with pytest.raises(InputError, match="same flight"):
        electrical_pool([flight("a"), flight("b")])
    with pytest.raises(InputError, match="earlier version"):
        electrical_pool([flight("a").with_curve(Kind.ELECTRICAL, statistics=None)])
    with pytest.raises(InputError, match="no speeds in common"):
        compared([flight("a")], [flight("b", speeds=V + 20.0)])


@pytest.mark.parametrize(
    ("vehicles", "names", "messages"),
    [
        (("", "", "1"), "AAA", []),
        (("1", "1", ""), "AAA", []),
        (("1", "2", "1"), "AAA", ["A: flights of 2 autopilots, 1 (0, 2); 2 (1)."]),
        (
            ("1", "1", "2"),
            "ABB",
            ["B: flights of 2 autopilots, 1 (1); 2 (2).", "Autopilot 1: flights of 2 names, A (0)"],
        ),
    ],
)
def test_flights_of_two_autopilots_are_reported_and_pooled(vehicles, names: str, messages: list[str]) -> None:
    flights = [
        flight(str(i), 1e-3 * i, vehicle=vehicle, name=name)
        for i, (vehicle, name) in enumerate(zip(vehicles, names, strict=True))
    ]
    result = electrical_pool(flights).results()
    assert len(result.notes) == len(messages)
    assert all(note.startswith(text) for note, text in zip(result.notes, messages, strict=True))
    assert [flight.vehicle for flight in result.flights] == list(vehicles) and result.trust is Trust.TRUSTED
    page = render_pooled(result)
    assert all(text in page for text in messages) and "<th>autopilot</th>" in page


@pytest.mark.parametrize(
    ("of_a", "of_b", "item"), [("1", "1", True), ("", "1", True), ("1", "2", False), ("11", "12", False)]
)
def test_errors_cancel_between_flights_that_one_autopilot_logged(of_a: str, of_b: str, item: bool) -> None:
    a, b = (
        [flight(f"{side}{i}", 1e-3 * (i + 10 * number), vehicle=v) for i, v in enumerate(vehicles or [""])]
        for number, (side, vehicles) in enumerate((("a", of_a), ("b", of_b)))
    )
    result = compared(a, b).results()
    widths = [row.hi_percent - row.lo_percent for row in result.differences]
    apart = [2 * row.independent_half_width_percent for row in result.differences]
    assert result.same_installation is item and (NOT_ONE_VEHICLE in result.notes) is not item
    assert (widths == pytest.approx(apart)) is not item
