"""What is measured on the ground before a flight: thrust on a stand, weight, center of gravity; the prior of thrust."""
