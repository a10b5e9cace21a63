"""The propeller tables that come with the package."""

from importlib import resources

FOLDER = resources.files("flightpower.flight") / "data" / "propellers"


def shipped_propellers() -> list[str]:
    """The names of the propellers that come with the package."""
    return sorted(f.name.removesuffix(".csv") for f in FOLDER.iterdir() if f.name.endswith(".csv"))
