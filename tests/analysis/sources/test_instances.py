"""Which of several batteries, motors and airspeed sensors is used, and which values of a channel are possible."""

import numpy as np
import pytest

from flightpower.analysis.sources import ardupilot, px4
from flightpower.analysis.sources.recording import (
    AIRSPEED_PRESSURE,
    CURRENT,
    FORCE_X,
    FORCE_Z,
    GPS,
    MOTOR,
    STATIC,
    VOLTAGE,
    Battery,
    Channel,
    channel,
    measuring_battery,
    most_varying,
    pressure_of_indicated_airspeed,
    turning_motor,
    without_clock_jumps,
)

T = np.arange(0, 100, 1.0)


def constant(value: float) -> Channel:
    return Channel(T, np.full(len(T), value))


def battery(name: str, current_A: float) -> Battery:
    return Battery(name, constant(12.0), constant(current_A))


@pytest.mark.parametrize(
    ("second_A", "messages"),
    [(1.5, ["b carries 15 % of the power of a"]), (0.5, []), (30.0, ["b measures", "a carries 33 %"])],
)
def test_the_battery_of_most_power_is_taken_and_a_tenth_beside_it_is_reported(
    second_A: float, messages: list[str]
) -> None:
    taken, notes = measuring_battery([battery("a", 10.0), battery("b", second_A)])
    assert taken is not None and taken.name == ("b" if second_A > 10 else "a")
    assert len(notes) == len(messages) and all(
        note.startswith(text) for note, text in zip(notes, messages, strict=True)
    )


def test_two_packs_that_feed_the_motor_are_added_and_one_measured_twice_is_counted_once() -> None:
    taken, (note,) = measuring_battery([battery("a", 10.0), battery("b", 8.0)])
    assert taken is not None and taken.current.value == pytest.approx(18.0) and "added" in note
    other = Battery("c", constant(24.0), constant(6.0))
    taken, _ = measuring_battery([other, battery("b", 10.0)])
    assert taken is not None
    assert taken.voltage.value * taken.current.value == pytest.approx(24.0 * 6.0 + 12.0 * 10.0)
    taken, (note,) = measuring_battery([battery("a", 10.0), battery("b", 9.8)])
    assert taken is not None and taken.current.value == pytest.approx(10.0) and "counted once" in note


def flown(name: str, share: float, sum_of: frozenset[str] = frozenset(), late_s: float = 0.0) -> Battery:
    """A monitor that shows a share of a motor's current, 5 to 15 A, at its own times."""
    t_s = T + late_s
    return Battery(name, constant(12.0), Channel(t_s, share * (10 + 5 * np.sin(t_s / 9))), sum_of)


@pytest.mark.parametrize("shares", [(0.6, 0.4), (0.5, 0.3, 0.2), (0.85, 0.15)])
@pytest.mark.parametrize("scale", [1.0, 1.03])
def test_a_monitor_that_shows_the_sum_of_others_is_counted_alone(shares: tuple[float, ...], scale: float) -> None:
    """This also holds for a meter that reads 3 % more and samples at other times; a pack outside the sum is added."""
    parts = [flown(f"part {i}", share, late_s=0.3) for i, share in enumerate(shares)]
    total = flown("total", scale)
    for order in ([total, *parts], [*parts, total]):
        taken, (note,) = measuring_battery(order)
        assert taken is not None and taken.name == "total" and taken.current.value == pytest.approx(total.current.value)
        assert note.startswith("total is the sum of part 0 and part 1")
    taken, (_, note) = measuring_battery([total, *parts, battery("apart", 9.0)])
    assert taken is not None and taken.current.value == pytest.approx(total.current.value + 9.0) and "added" in note


def test_two_packs_that_make_up_an_eighth_less_or_more_than_a_third_are_no_parts_of_it() -> None:
    for share in (0.56, 0.44):
        taken, _ = measuring_battery([flown("a", 1.0), flown("b", share), flown("c", share)])
        assert taken is not None
        expected = 1.0 + 2 * share if share > 0.5 else 1.0
        assert np.mean(taken.current.value) == pytest.approx(expected * np.mean(flown("a", 1.0).current.value))


def test_a_sum_by_the_autopilots_parameter_is_never_added_to_its_parts() -> None:
    """Its value may differ from the sum of the parts; if it shows less than one part, the parts are counted."""
    parts, names = [flown("a", 0.6), flown("b", 0.5)], frozenset({"a", "b"})
    for share, counted in ((1.0, 1.0), (0.1, 1.1)):
        taken, _ = measuring_battery([flown("total", share, names), *parts])
        assert taken is not None
        assert taken.current.value == pytest.approx(counted * flown("", 1.0).current.value)


@pytest.mark.parametrize(
    ("parameters", "summed"),
    [
        ({"BATT_MONITOR": 10.0}, ["BAT 1", "BAT 2", "BAT2 0"]),
        ({"BATT_MONITOR": 10.0, "BATT_SUM_MASK": 4.0}, ["BAT 2"]),
        ({"BATT_MONITOR": 10.0, "BATT_SUM_MASK": np.nan}, ["BAT 1", "BAT 2", "BAT2 0"]),
        ({"BATT2_MONITOR": 10.0, "BATT2_SUM_MASK": 5.0}, ["BAT 0", "BAT 2"]),
        ({"BATT_MONITOR": 4.0, "BATT_SUM_MASK": 6.0}, []),
    ],
)
def test_ardupilots_monitor_of_kind_ten_sums_those_of_its_mask_or_all_later_ones(
    parameters: dict[str, float], summed: list[str]
) -> None:
    monitors = {(kind, i): battery(f"{kind} {i}", 1.0) for kind, i in [("BAT", 0), ("BAT", 1), ("BAT", 2), ("BAT2", 0)]}
    batteries = ardupilot._with_sums(monitors, parameters)
    assert sorted({name for battery in batteries for name in battery.sum_of}) == summed


def test_a_battery_without_discharge_does_not_measure() -> None:
    empty = Battery("c", Channel(T[:0], T[:0]), constant(3.0))
    assert measuring_battery([battery("a", -5.0), empty]) == (None, [])


def test_the_one_motor_that_turns_is_taken() -> None:
    result, notes = turning_motor([constant(1.0), constant(80.0)])
    assert result is not None and result.value[0] == 80.0 and notes == []
    assert turning_motor([constant(4.0)]) == (None, [])
    none, (note,) = turning_motor([constant(80.0), constant(90.0)])
    assert none is None and note.startswith("2 motors turn")


def test_the_airspeed_sensor_that_varies_most_is_the_connected_one() -> None:
    connected = Channel(T, 100 + 20 * np.sin(T))
    taken = most_varying([constant(3.0), Channel(T, np.sin(T)), connected])
    assert taken is connected and most_varying([constant(3.0)]) is None


def px4_topics(**fields: np.ndarray) -> dict[str, list[px4._Topic]]:
    return {"sensor_baro": [px4._Topic({"timestamp": 1e6 * T, **fields}, 0)]}


@pytest.mark.parametrize("in_unit", [95_000.0, 950.0])
def test_static_pressure_of_old_firmware_is_in_hectopascal(in_unit: float) -> None:
    (static,) = px4._static(px4_topics(pressure=np.full(len(T), in_unit))).values()
    assert static.value == pytest.approx(95_000.0) and static.t_s == pytest.approx(T)


def left_of(name: str, value: np.ndarray, t_s: np.ndarray = T) -> np.ndarray:
    """The values of a channel that are kept; empty if the channel is left out."""
    regular, _ = without_clock_jumps(Channel(t_s, value), {name: Channel(t_s, value)})
    return regular[name].value if name in regular else np.array([])


@pytest.mark.parametrize(
    ("name", "least", "greatest"),
    [
        (AIRSPEED_PRESSURE, -2000.0, 20_000.0),  # beyond the range of every airspeed sensor
        (STATIC, 20_000.0, 120_000.0),  # 11 km, and a mine
        (FORCE_X, -300.0, 300.0),  # 30 g
        (FORCE_Z, -300.0, 300.0),
        (VOLTAGE, 0.0, 1000.0),
        (CURRENT, -1000.0, 2000.0),
        (MOTOR, 0.0, 2000.0),  # 120 000 rev/min
        (GPS[2], -300.0, 300.0),
        ("a thermometer [K]", 150.0, 450.0),
    ],
)
def test_what_no_small_aircraft_can_measure_is_left_out(name: str, least: float, greatest: float) -> None:
    room = 0.02 * (greatest - least)
    for value, possible in ((least, True), (least - room, False), (greatest, True), (greatest + room, False)):
        assert len(left_of(name, np.full(100, value))) == (100 if possible else 0), value


@pytest.mark.parametrize(
    ("name", "usual", "spike"),
    [(AIRSPEED_PRESSURE, 100.0, 600.0), (STATIC, 1e5, 300.0), (FORCE_X, 0.0, 100.0), (FORCE_Z, -9.8, 100.0),
     (VOLTAGE, 12.0, 50.0),
     (CURRENT, 20.0, 300.0), (MOTOR, 100.0, 100.0), (GPS[0], 15.0, 30.0), ("a thermometer [K]", 290.0, 50.0)],
)  # fmt: skip
def test_a_single_value_far_from_its_neighbors_is_left_out(name: str, usual: float, spike: float) -> None:
    """A deviation of three samples is not a spike. The first and the last sample can be spikes."""
    for i in (0, 1, 50, 98, 99):
        for height, is_plausible in ((0.95, True), (1.05, False)):
            value = np.full(100, usual)
            value[i] += height * spike
            assert len(left_of(name, value)) == (100 if is_plausible else 99)
    lasting = np.full(100, usual)
    lasting[50:53] += 1.05 * spike
    assert len(left_of(name, lasting)) == 100


def test_the_longest_part_without_a_jump_of_the_clock_is_used() -> None:
    """A jump is a step back by more than a second, or ahead by more than a minute; gaps are not jumps."""
    value = np.arange(100.0)
    gap, ahead = T + 55.0 * (T > 30), T + 65.0 * (T > 30)
    back, late = T - 30.0 * (T > 60), 0.4 * T - 1.1 * (T > 60)
    assert len(left_of(CURRENT, value, gap)) == 100
    regular, (note,) = without_clock_jumps(Channel(ahead, value), {CURRENT: Channel(ahead, value)})
    assert regular[CURRENT].value.tolist() == value[31:].tolist()
    assert note == "The log's clock jumped; the longest part without a jump, 68 s, is used."
    regular, _ = without_clock_jumps(Channel(back, value), {CURRENT: Channel(back, value)})
    assert regular[CURRENT].value.tolist() == value[:61].tolist()
    # If the clock steps back by less than a second, the times that come again are left out.
    assert left_of(CURRENT, value, late).tolist() == value[(T < 61) | (T > 62)].tolist()


def test_a_wrong_time_between_two_right_ones_costs_its_sample() -> None:
    value = np.arange(100.0)
    for wrong in (1000.0, -1000.0):
        t = T.copy()
        t[40] = wrong
        assert left_of(CURRENT, value, t).tolist() == value[T != 40].tolist()


def test_a_channel_of_fewer_than_twenty_samples_is_left_out() -> None:
    assert (
        len(left_of(CURRENT, np.full(19, 3.0), T[:19])) == 0 and len(left_of(CURRENT, np.full(20, 3.0), T[:20])) == 20
    )
    assert len(channel([0.0, 1.0, np.nan, 3.0], [1.0, np.inf, 2.0, 5.0]).t_s) == 2


def test_the_pressure_of_an_indicated_airspeed_is_that_at_sea_level() -> None:
    assert pressure_of_indicated_airspeed([20.0, 0.0, -10.0]) == pytest.approx([245.0, 0.0, -61.25])
