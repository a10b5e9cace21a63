"""What to fly and what it costs: plans for the narrowest interval, their card, and the energy of a mission in wind."""
