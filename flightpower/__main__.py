"""`python -m flightpower`"""

from flightpower.scripts import flightpower

if __name__ == "__main__":
    flightpower()
