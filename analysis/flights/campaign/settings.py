"""Settings for the analysis of many logs (docs/use/many-flights.md)."""

from dataclasses import dataclass

from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class CampaignLimits(Settings):
    """Limits for each analysis among many, and for keeping a cluster busy."""

    memory_GB: float = setting(
        4.0, "GB", "of one analysis (2^30 bytes each): a flight of two hours needs a quarter of it"
    )
    connect_s: float = setting(
        10.0, "s", "a scheduler or a store of logs that does not answer within this is not there"
    )
    queued_per_thread: int = setting(
        2, "jobs", "at the scheduler for each thread of a worker: the next one is there when one ends"
    )


CAMPAIGN = CampaignLimits()
