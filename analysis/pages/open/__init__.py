"""The page of `flightpower open`, on this computer only: look at a flight, edit its runs and values, see the curve."""
