"""Decodes part numbers of Honeywell TruStability SSC and HSC with I2C output (datasheet, "Nomenclature")."""

import re

from flightpower.daq.sensors.bridge import INCH_OF_WATER_PA, PSI_PA, TransferFunction

UNIT_PA = {"N": INCH_OF_WATER_PA, "P": PSI_PA, "M": 100.0, "B": 1e5, "K": 1e3, "L": 1.0}
# Counts at the ends of the range (datasheet, table of output limits).
OUTPUT = {"A": (1638, 14746), "B": (819, 15565), "C": (819, 13926), "F": (655, 15401)}
ADDRESSES = {str(digit): 0x08 + 0x10 * digit for digit in range(2, 8)}  # 2 is 0x28; 3 to 7 not confirmed
CODE = re.compile(r"(?:SSC|HSC)[DMS][A-Z]{2}[NDTV](\d{3}|\d\.\d)([NPMBKL])([DG])([2-7])([ABCF])([35])")
SUPPORTED = (
    "SSC or HSC, package, ports, option, range (three characters) and unit N|P|M|B|K|L, D|G, I2C address 2..7, "
    "output A|B|C|F, supply 3|5, such as SSCDRRN005ND2A5"
)


def decode_part(number: str) -> tuple[int, TransferFunction]:
    """Address and transfer function of a part number.

    Raises ValueError, naming the supported numbers, for any other number; absolute, analog and SPI parts are not
    supported.
    """
    match = CODE.fullmatch(number.strip().upper())
    if match is None or float(match[1]) == 0:
        raise ValueError(f"{number!r} is not a supported part number; supported are {SUPPORTED}")
    span, unit, kind, address, output, _ = match.groups()
    top_Pa = float(span) * UNIT_PA[unit]
    low, high = OUTPUT[output]
    return ADDRESSES[address], TransferFunction(low, high, -top_Pa if kind == "D" else 0.0, top_Pa)
