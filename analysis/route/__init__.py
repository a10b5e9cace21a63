"""The energy of a mission in wind: read the mission, choose speeds, draw what is uncertain, sum up."""
