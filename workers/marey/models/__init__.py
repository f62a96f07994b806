"""Generators: one folder per model."""
