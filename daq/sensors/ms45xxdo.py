"""Decodes order codes of TE MS4515DO (inches of water) and MS4525DO (psi) (datasheets, "Ordering information")."""

import re

from flightpower.daq.sensors.bridge import FULL_COUNT, INCH_OF_WATER_PA, PSI_PA, TransferFunction

UNIT_PA = {"4515": INCH_OF_WATER_PA, "4525": PSI_PA}
OUTPUT = {"A": (0.10, 0.90), "B": (0.05, 0.95)}  # fractions of full count at the ends of the range
ADDRESSES = {"I": 0x28, "J": 0x36, "K": 0x46, **{str(digit): 0x48 + digit for digit in range(10)}}
CODE = re.compile(r"(?:MS)?(4515|4525)DO-?DS([35])([AB])([IJK0-9])(\d{3})([DG])P")
SUPPORTED = (
    "MS4515DO-DS<3|5 V><A|B output><I|J|K|0..9 address><range, three digits><D|G>P, such as MS4515DO-DS5AJ002DP "
    "(MS4525DO likewise)"
)


def decode_part(number: str) -> tuple[int, TransferFunction]:
    """Address and transfer function of a part number.

    Raises ValueError, naming the supported numbers, for any other number.
    """
    match = CODE.fullmatch(number.strip().upper())
    if match is None or int(match[5]) == 0:
        raise ValueError(f"{number!r} is not a supported part number; supported are {SUPPORTED}")
    family, _, output, address, span, kind = match.groups()
    top_Pa = int(span) * UNIT_PA[family]
    low, high = OUTPUT[output]
    transfer = TransferFunction(low * FULL_COUNT, high * FULL_COUNT, -top_Pa if kind == "D" else 0.0, top_Pa)
    return ADDRESSES[address], transfer
