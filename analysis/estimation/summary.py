"""A fit's numbers without its data: a table to read, and a JSON file to keep."""

from pathlib import Path

import msgspec

from flight.errors import InputError
from flight.json_file import JsonFormat

FORMAT = "flightpower fit 1"
LARGE_CORRELATION = 0.9  # above it the data determine two unknowns only together (Klein & Morelli 2006, ch. 5)


class SummaryRow(msgspec.Struct, frozen=True):
    """One unknown. standard_error : Cramer-Rao, priors included     corrected : for colored residuals, if computed."""

    name: str
    unit: str
    value: float
    standard_error: float | None
    corrected: float | None = None


class FitSummary(msgspec.Struct, frozen=True):
    """The numbers of a fit.

    rows : of the m unknowns     fixed : parameters that were not estimated, by name
    correlation : (m, m)     noise : standard deviations of the residuals by output
    """

    model: str
    status: str
    verdict: str
    iterations: int
    samples: int
    negative_log_likelihood: float
    rows: list[SummaryRow]
    fixed: dict[str, float]
    correlation: list[list[float | None]]
    noise: dict[str, float]
    format: str = FORMAT

    def table(self) -> str:
        """Estimates, standard errors and large correlations as text, 100 columns wide at most."""
        corrected = any(row.corrected is not None for row in self.rows)
        heading = f"{'':24}{'estimate':>13}{'std error':>12}{'corrected' if corrected else '':>12}  unit"
        lines = [f"{self.model}: {self.verdict} ({self.samples} values)", heading.rstrip()]
        partners = self._partners()
        for i, row in enumerate(self.rows):
            error = "undetermined" if row.standard_error is None else f"{row.standard_error:.3g}"
            wider = "" if row.corrected is None else f"{row.corrected:.3g}"
            line = f"{row.name[:24]:24}{row.value:13.6g}{error:>13}{wider if corrected else '':>12}  {row.unit:8}"
            lines.append((line + partners.get(i, "")).rstrip())
        lines += [f"{name[:24]:24}{value:13.6g}       fixed" for name, value in self.fixed.items()]
        lines.append("residuals (rms): " + ", ".join(f"{name} {sigma:.3g}" for name, sigma in self.noise.items()))
        return "\n".join(lines)

    def _partners(self) -> dict[int, str]:
        """For each unknown its largest correlation with another, as text, if it is large."""
        found = {}
        for i, row in enumerate(self.correlation):
            others = [(abs(value), j) for j, value in enumerate(row) if value is not None and j != i]
            size, j = max(others, default=(0.0, 0))
            if size > LARGE_CORRELATION:
                found[i] = f"correlated with {self.rows[j].name} ({row[j]:+.3f})"
        return found


def save_summary(summary: FitSummary, file: Path) -> None:
    """Write JSON. Raises InputError if the file exists."""
    if file.exists():
        raise InputError(f"{file}: exists already; give another name")
    file.write_bytes(msgspec.json.format(msgspec.json.encode(summary), indent=2) + b"\n")


def load_summary(file: Path) -> FitSummary:
    """Read what `save_summary` wrote. Raises InputError for another kind of file."""
    return JsonFormat(FitSummary, (FORMAT,), "a saved fit").parsed(file.read_bytes(), str(file))
