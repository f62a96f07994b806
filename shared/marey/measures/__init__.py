"""Comparison of measurements: numpy alone, for workers that report and servers that answer."""
