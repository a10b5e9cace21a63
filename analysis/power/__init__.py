"""Power required: what follows from a drag polar, and one file for each way of getting there."""
