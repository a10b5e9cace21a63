"""The part of `results.json` that the source's own estimators add (`analyze --likelihood`)."""

import msgspec


class PitchRateResult(msgspec.Struct, frozen=True, kw_only=True):
    """Whether the pitch rate in the runs was large enough to matter for lift: significance of C_Lq (4.3)-(4.7)."""

    signal_to_noise: dict[str, float]  # by run: variance of the pitch rate over that of its noise
    noise_radps: float  # standard deviation of the pitch rate's noise, of one sample
    CLq: float  # estimated without a prior
    standard_error: float  # of white residuals (4.2), as the source has it
    standard_error_corrected: float  # for colored residuals
    t: float  # (4.4)
    critical_t: float
    significant: bool
