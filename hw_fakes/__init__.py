"""Devices at register and byte level, behind the interfaces that real ones have.

They turn what the simulator says (`sim.felt.Felt`) into counts and bytes, on whatever clock they are given.
"""
