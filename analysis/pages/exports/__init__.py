"""An analyzed flight as tables and as files that other programs open (docs/use/exports.md)."""

KINDS = ("parquet", "csv", "mat", "mcap")
FOLDERS = ("csv", "parquet")  # kinds that are a folder with one file per table
