"""The mounting of a chip in the aircraft: which of its axes lies along each body axis, with sign."""

Axes = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]  # chip axis index and sign for each of body x, y, z
BODY_AXES: Axes = ((0, 1), (1, 1), (2, 1))
SIGNED = ("x", "y", "z", "-x", "-y", "-z")


def parse_axes(names: tuple[str, ...]) -> Axes:
    """Parse axes: ("y", "-x", "z") means that body x is the chip's y, body y is minus the chip's x, body z is the
    chip's z.

    Raises ValueError unless the three are a right-handed set.
    """
    axes = [("xyz".index(name[-1]), -1 if name[0] == "-" else 1) for name in names if name in SIGNED]
    if len(axes) != 3 or len({axis for axis, _ in axes}) != 3:
        raise ValueError(f"axes {list(names)}: name each of x, y, z once, with a minus sign where it is reversed")
    (i, si), (j, sj), (k, sk) = axes
    parity = 1 if (j - i) % 3 == 1 else -1
    if parity * si * sj * sk != 1:
        raise ValueError(f"axes {list(names)}: not a right-handed set; a sign is wrong or two axes are exchanged")
    return (i, si), (j, sj), (k, sk)


def to_body_axes(vector: tuple[float, float, float], axes: Axes) -> tuple[float, float, float]:
    """Transform a vector from the chip's axes to body axes."""
    (i, si), (j, sj), (k, sk) = axes
    return si * vector[i], sj * vector[j], sk * vector[k]
