"""How a chip sits in the aircraft: which of its axes lies along each body axis, and which way round."""

Axes = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]  # body x, y, z: which chip axis, and its sign
ALONG_THE_BODY: Axes = ((0, 1), (1, 1), (2, 1))
SIGNED = ("x", "y", "z", "-x", "-y", "-z")


def parse_axes(names: tuple[str, ...]) -> Axes:
    """("y", "-x", "z") says: body x is the chip's y, body y is minus the chip's x, body z is the chip's z.

    Raises ValueError unless the three make a right-handed set.
    """
    axes = [("xyz".index(name[-1]), -1 if name[0] == "-" else 1) for name in names if name in SIGNED]
    if len(axes) != 3 or len({axis for axis, _ in axes}) != 3:
        raise ValueError(f"axes {list(names)}: name each of x, y, z once, with a minus sign where it is turned round")
    (i, si), (j, sj), (k, sk) = axes
    turns = 1 if (j - i) % 3 == 1 else -1
    if turns * si * sj * sk != 1:
        raise ValueError(f"axes {list(names)}: not a right-handed set; a sign is wrong, or two are exchanged")
    return (i, si), (j, sj), (k, sk)


def turned(vector: tuple[float, float, float], axes: Axes) -> tuple[float, float, float]:
    """A vector in the chip's axes, in body axes."""
    (i, si), (j, sj), (k, sk) = axes
    return si * vector[i], sj * vector[j], sk * vector[k]
