"""The results of many flights' folders, read for the joint estimate."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from analysis.campaign.flight_folders import RESULTS
from analysis.results.schema import Results
from analysis.results.trust import NOT_TO_TRUST, reasons_not_to_trust
from flight.errors import InputError

# Parts of results.json that the joint estimate does not use, and that would take most of the memory.
UNUSED = ("methods", "one_by_one", "cross_check", "power_required_standard", "interval_parts", "path", "use", "runs")


class FlightResults(NamedTuple):
    """Contents of results.json, `log` in them being the folder's name. left_out: why others are not in the pool."""

    to_pool: list[dict[str, Any]]
    electrical: list[dict[str, Any]]  # flights that give electrical power only
    left_out: list[str]

    @property
    def not_to_trust(self) -> list[str]:
        """Flights to pool whose results are not to be trusted, each with the reason."""
        return [f"{one['log']}: {reason}" for one in self.to_pool for reason in one[NOT_TO_TRUST]]


def read_results(folders: Sequence[Path]) -> FlightResults:
    """The results in flights' folders. Flights without statistics for pooling are left out, with a reason.

    Raises InputError when a file cannot be read.
    """
    found = FlightResults([], [], [])
    for folder in folders:
        content = read_json(folder / RESULTS)
        content["log"] = folder.name
        content[NOT_TO_TRUST] = _reasons(content)
        content = {name: value for name, value in content.items() if name not in UNUSED}
        if content.get("pooling") is not None:
            found.to_pool.append(content)
        elif content.get("electrical") is not None:
            found.electrical.append(content)
            found.left_out.append(f"{folder.name}: gives electrical power only, which is not pooled")
        else:
            found.left_out.append(f"{folder.name}: has no accelerations and decelerations, and is not pooled")
    return found


def _reasons(content: dict[str, Any]) -> list[str]:
    """Reasons not to trust the results of a flight; none where another version wrote them."""
    try:
        return reasons_not_to_trust(msgspec.convert(content, Results))
    except msgspec.ValidationError:
        return []


def flight_folders_of(folder: Path) -> list[Path]:
    """The flights' folders of a pool, of a folder with several, or the folder itself where it is that of one flight.

    Raises InputError when there are no results.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder; give one that `analyze` wrote")
    if not (folder / RESULTS).is_file():
        found = sorted(path.parent for path in folder.glob(f"*/{RESULTS}"))
        if not found:
            raise InputError(f"{folder}: no {RESULTS} in it; give a folder that `analyze` wrote")
        return found
    flights = read_json(folder / RESULTS).get("flights")
    return [folder] if flights is None else [folder / str(flight["log"]) for flight in flights]


def read_json(path: Path) -> dict[str, Any]:
    """The content of a results.json. Raises InputError when it cannot be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=dict[str, Any])
    except (OSError, msgspec.DecodeError, msgspec.ValidationError) as error:
        raise InputError(f"{path}: cannot be read ({error}); analyze the log again") from None
