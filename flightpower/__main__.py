"""`python -m flightpower`"""

from flightpower.scripts import flightpower as main

if __name__ == "__main__":
    main()
