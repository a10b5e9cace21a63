"""From a log to synchronized channels, their smoothing, rest on the ground, and the zeros of the sensors there."""
