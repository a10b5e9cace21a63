"""Rows of flights in a dataset: a pool of rows equals a pool of results, whatever the order and the location."""

from pathlib import Path

import pytest
from fleet_flights import flights_of

from flightpower.analysis.flights.dataset import Added, Dataset
from flightpower.analysis.flights.pool import joint_pool, pool
from flightpower.flight.errors import InputError
from tests.s3_server import running


@pytest.fixture(params=["folder", "memory"])
def dataset(request: pytest.FixtureRequest, tmp_path: Path) -> Dataset:
    """The location of a dataset: a folder, and an object store in memory that fsspec keeps."""
    return Dataset(str(tmp_path / "fleet") if request.param == "folder" else f"memory://{tmp_path.name}/fleet")


def test_flights_read_back_give_the_same_pool(dataset: Dataset) -> None:
    results = flights_of("one", 1, 6)
    assert dataset.add(results) == Added(6, 0)
    ((flights),) = dataset.flights("one").values()
    assert [flight.name for flight in flights] == [flight["log"] for flight in results]
    ours, direct = pool(flights), joint_pool(results)
    assert (ours.polar.A == direct.polar.A).all() and (ours.polar.covariance == direct.polar.covariance).all()


def test_order_and_repetition_change_nothing(dataset: Dataset, tmp_path: Path) -> None:
    results = flights_of("one", 1, 6)
    other = Dataset(str(tmp_path / "other"))
    dataset.add(results)
    for flight in reversed(results):
        assert other.add([flight]) == Added(1, 0)
    assert other.add(results) == Added(0, 6)
    ((here),), ((there),) = dataset.flights("one").values(), other.flights("one").values()
    assert [item.name for item in here] == [item.name for item in there]


def test_airframes_and_configurations_are_kept_apart(dataset: Dataset) -> None:
    moved = flights_of("two", 3, 2)
    for flight in moved:
        flight["pooling"]["installation"] = "new boom"
    dataset.add([*flights_of("one/a", 1, 2), *flights_of("two", 2, 2), *moved])
    assert dataset.airframes == ["one/a", "two"]
    assert sorted(len(flights) for flights in dataset.flights("two").values()) == [2, 2]
    assert dataset.flights("three") == {}


def test_a_damaged_file_costs_its_flights_only(tmp_path: Path) -> None:
    dataset, unread = Dataset(str(tmp_path)), list[str]()
    dataset.add(flights_of("one", 1, 2))
    dataset.add(flights_of("one", 2, 3))
    damaged = sorted(tmp_path.glob("*/*.parquet"))[0]
    damaged.write_bytes(damaged.read_bytes()[:100])
    (flights,) = dataset.flights("one", unread).values()
    assert len(flights) in (2, 3) and len(unread) == 1 and damaged.name in unread[0]
    with pytest.raises(InputError, match=damaged.name):
        dataset.flights("one")


def test_a_dataset_in_a_bucket_is_read_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bucket is on an S3 server of the test; a second addition adds files and changes none."""
    pytest.importorskip("s3fs")
    first, later = flights_of("one/a", 1, 3), flights_of("one/a", 2, 2)
    with running() as store:
        for name, value in store.environment.items():
            monkeypatch.setenv(name, value)
        store.objects["bucket/other"] = b""  # the bucket exists
        dataset = Dataset("s3://bucket/fleet")
        assert dataset.add(first) == Added(3, 0)
        written = dict(store.objects)
        assert dataset.add([*first, *later]) == Added(2, 3)
        assert {name: store.objects[name] for name in written} == written
        (flights,) = Dataset("s3://bucket/fleet").flights("one/a").values()
        assert sorted(flight.name for flight in flights) == sorted(flight["log"] for flight in [*first, *later])


def test_results_without_statistics_are_refused_and_nothing_is_written(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        Dataset(str(tmp_path / "fleet")).add([*flights_of("one", 1, 1), {"log": "x", "pooling": None}])
    assert not (tmp_path / "fleet").exists()


@pytest.mark.parametrize("address", ["nothing://there", "s3x//"])
def test_an_address_that_cannot_be_reached_is_one_line(address: str) -> None:
    with pytest.raises(InputError):
        _ = Dataset(address).airframes


def test_a_flight_takes_about_two_kilobytes(tmp_path: Path) -> None:
    Dataset(str(tmp_path)).add(flights_of("one", 1, 200))
    assert sum(path.stat().st_size for path in tmp_path.glob("*/*.parquet")) < 200 * 2500
