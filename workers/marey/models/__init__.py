"""Generators: one folder a model."""
