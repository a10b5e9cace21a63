"""From raw channels to speed, flow angles and density at the center of gravity."""
