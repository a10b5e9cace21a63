"""Flight plans for the narrowest interval: what each maneuver contributes to the estimate, before it is flown."""
