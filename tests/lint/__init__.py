"""Checks that `make lint` runs beside ruff, basedpyright and import-linter."""
