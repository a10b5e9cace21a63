"""Tables of other people's flights: CSV, Parquet and .mat with a map of their columns, as a log of the daemon.

`read` gives the columns of a file, `column_map` says which quantity each is, `consistency` compares the quantities with
each other by laws of physics, `log_of_table` writes them as the messages of a log, `draft` proposes a map.
"""
