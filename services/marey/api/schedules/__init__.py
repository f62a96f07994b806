"""Schedules: evaluations that come again."""
