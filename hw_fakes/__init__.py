"""Fake devices at register and byte level, behind the interfaces of real devices.

They turn the physical inputs of the sensors (`sim.sensor_truth.SensorTruth`) into counts and bytes. Their clock is
passed in.
"""
