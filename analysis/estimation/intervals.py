"""The factor of 95 % confidence intervals."""

NORMAL_95 = 1.959964  # half width of the central 95 % of a normal distribution, in standard deviations
