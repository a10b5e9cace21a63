"""The report: one HTML file that needs no network, with the same results as JSON and CSV and a table for the field."""
