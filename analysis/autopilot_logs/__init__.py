"""Logs of autopilots: PX4 (ULog) and ArduPilot (dataflash), read into the channels of an ordinary flight."""
