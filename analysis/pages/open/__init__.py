"""The page of `flightpower open`, for this computer only: view a flight, edit its runs and values, see the curve."""
