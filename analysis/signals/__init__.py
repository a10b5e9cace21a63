"""From a log to synchronized channels; rest and the zeros of the sensors."""
