"""Evaluations: runs that measure a model, and their reports."""
