"""Analysis of many logs on all processors or on a cluster, without repeating finished work."""
