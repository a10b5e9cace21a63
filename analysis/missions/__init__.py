"""Plans for the narrowest interval, the card that shows them to the pilot, and the energy of a mission in wind."""
