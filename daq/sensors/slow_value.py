"""Recognizes a damaged reply by a number in it that can only change slowly: the temperature of the part."""


class SlowValue:
    """The number's latest value that fitted. step: the largest difference of two readings, by noise and quantization;
    per_s: how much farther it may drift in each second without a fitting reading. believed_after: as many readings in a
    row that agree with each other are believed, whatever came before; None where damage may agree with itself.
    """

    def __init__(self, step: float, per_s: float, believed_after: int | None = None):
        self._step, self._per_ns = step, per_s * 1e-9
        self._believed_after = believed_after
        self._other, self._others = 0.0, 0  # the latest that did not fit, and how many in a row agreed with it
        self._value: float | None = None
        self._settled = False  # two readings in a row have agreed
        self._time_ns = 0

    def fits(self, value: float, now_ns: int) -> bool:
        """Whether `value` can be the number's value now. The first one is believed, until the second contradicts it."""
        if self._value is None:
            self._value, self._time_ns = value, now_ns
            return True
        fitting = abs(value - self._value) <= self._step + self._per_ns * (now_ns - self._time_ns)
        if not fitting:
            self._others = self._others + 1 if abs(value - self._other) <= self._step else 1
            self._other = value
        if fitting or not self._settled or self._others == self._believed_after:
            self._value, self._time_ns, self._settled, self._others = value, now_ns, fitting, 0
        return fitting
