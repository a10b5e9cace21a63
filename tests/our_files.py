"""Names of our modules, as imports write them, and the files that hold them."""

PARTS = ("analysis", "daq", "flight", "hw_fakes", "sim")  # installed inside `flightpower`; in the repository beside it


def dotted_path(module: str) -> str:
    """The folders and the file of a module, with dots: `flightpower.daq.config` lies in daq."""
    inside = module.removeprefix("flightpower.")
    return inside if inside.split(".")[0] in PARTS else module


def module_of(dotted: str) -> str:
    """The name by which imports know a file."""
    return f"flightpower.{dotted}" if dotted.split(".")[0] in PARTS else dotted
