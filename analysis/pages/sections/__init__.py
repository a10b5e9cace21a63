"""The sections of the report page: numbers of `results.json` in words and table rows, without HTML."""
