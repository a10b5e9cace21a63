"""The ground floor: what both sides of the log mean by a message, an aircraft, the air, a propeller and motion.

Imports nothing of ours. Modules that the daemon uses (`messages`, `log_writer`, `log_reader`, `aircraft`, `units`,
`errors`) need no NumPy; the physics (`atmosphere`, `aerodynamics`, `motion`, `propeller`) is written with NumPy
functions, so that numbers, arrays and CasADi symbols pass through alike.
"""
