"""Schedules: recurring evaluations."""
