"""Recognizes a damaged reply by a number in it that can only change slowly: the temperature of the part."""

TRUSTED = 100  # so many agreeing readings show that the first was not damaged


class SlowValue:
    """Tracks the latest value that fitted.

    step: largest difference between two readings by noise and quantization. per_s: how much farther the number may
    drift in each second without a fitting reading. believed_after: number of successive readings that must agree on
    another value to be believed. If fewer readings than that, and fewer than TRUSTED, agreed on the old value, as many
    suffice.
    """

    def __init__(self, step: float, per_s: float, believed_after: int):
        self._step, self._per_ns = step, per_s * 1e-9
        self._believed_after = believed_after
        self._value: float | None = None
        self._time_ns = self._agreed = 0
        self._other, self._others = 0.0, 0  # the latest value that did not fit, and how many in a row agreed with it

    def fits(self, value: float, now_ns: int) -> bool:
        """Whether `value` can be the number's value now. The first one is believed."""
        reference = self._value
        if reference is not None and abs(value - reference) <= self._step:  # nearly always
            self._value, self._time_ns, self._others = value, now_ns, 0
            self._agreed += 1
            return True
        if reference is not None and abs(value - reference) > self._step + self._per_ns * (now_ns - self._time_ns):
            self._others = self._others + 1 if abs(value - self._other) <= self._step else 1
            self._other = value
            needed = self._believed_after if self._agreed >= TRUSTED else min(self._agreed, self._believed_after)
            if self._others < needed:
                return False
            self._agreed = 0
        self._value, self._time_ns, self._others = value, now_ns, 0
        self._agreed += 1
        return True
