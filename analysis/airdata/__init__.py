"""From raw channels to speed, flow angles and density at the centre of gravity."""
