"""The same analysis of many logs: on all processors or a cluster, without repeating what is already done."""
