"""Analyzes many logs on all processors or a cluster, without repeating finished work."""
