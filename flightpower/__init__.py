"""The command `flightpower`, with all others under it. It imports a side only when its command is called."""
