"""The modules that all other packages share: log messages, aircraft file, atmosphere, propeller, equations of motion.

It imports no other package of this project. Modules that the daemon uses (`messages`, `log_writer`, `log_reader`,
`log_index`, `files`, `aircraft`, `units`, `errors`) need no NumPy. The physics (`atmosphere`, `aerodynamics`,
`motion`, `propeller`) is written with NumPy functions and accepts floats, arrays and CasADi symbols.
"""
