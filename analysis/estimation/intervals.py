"""What every interval here is made of."""

NORMAL_95 = 1.959964  # standard errors to either side hold 95 % of a normal distribution
