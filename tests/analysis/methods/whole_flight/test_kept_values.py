"""A numerical derivative reuses unaffected values and recomputes everything else."""

from itertools import pairwise

from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.methods.whole_flight.kept_values import Kept


def test_only_terms_that_read_a_moved_parameter_are_computed_again() -> None:
    computed = {"inner": 0, "outer": 0}

    def inner_of(p: NamedValues) -> float:
        computed["inner"] += 1
        return float(p.a * p.b)

    def outer_of(p: NamedValues) -> float:
        computed["outer"] += 1
        return float(inner(p) + p["c"])

    inner, outer = Kept(inner_of), Kept(outer_of)
    base = {"a": 2.0, "b": 3.0, "c": 5.0, "d": 7.0}
    assert outer(NamedValues("parameter", base)) == 11.0
    for name, expected in (("a", 14.0), ("b", 13.0), ("c", 12.0), ("d", 11.0)):
        assert outer(NamedValues("parameter", base | {name: base[name] + 1})) == expected
    assert outer(NamedValues("parameter", base)) == 11.0
    assert computed == {"inner": 3, "outer": 4}, "the first value stays while each parameter is moved once"


def test_what_an_inner_function_reads_counts_even_where_its_value_was_known() -> None:
    inner = Kept(lambda p: p.a + p.b)
    first, moved = (NamedValues("parameter", {"a": 1.0, "b": b}) for b in (2.0, 20.0))
    assert [inner(item) for item in (first, moved, first)] == [3.0, 21.0, 3.0]
    outer = Kept(lambda p: 10 * inner(p))  # begins where the inner one knows both
    assert [outer(item) for item in (first, moved, first)] == [30.0, 210.0, 30.0]


def test_values_that_are_kept_are_as_few_as_a_derivative_needs() -> None:
    square = Kept(lambda p: [p.a**2])
    values = [square(NamedValues("parameter", {"a": float(a)})) for a in range(100)]
    assert len(square._entries) == 3
    assert square(NamedValues("parameter", {"a": 99.0})) is values[-1]
    assert all(square != other for square, other in pairwise(values))
