"""The significance of the pitch rate in the form of `results.json`."""

from analysis.drag.likelihood import PitchRate
from analysis.schema import PitchRateResult


def pitch_rate_result(found: PitchRate) -> PitchRateResult:
    return PitchRateResult(
        signal_to_noise=found.snr,
        noise_radps=found.noise_radps,
        CLq=found.CLq,
        standard_error=found.standard_error,
        standard_error_corrected=found.corrected_error,
        t=found.t,
        critical_t=found.critical,
        significant=found.significant,
    )
