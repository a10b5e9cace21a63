"""Devices at register and byte level, behind the interfaces that real ones have.

They turn the physical inputs of the sensors (`sim.sensor_truth.SensorTruth`) into counts and bytes. The clock is given.
"""
