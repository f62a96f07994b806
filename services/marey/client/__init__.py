"""The Python client of a Marey server."""
