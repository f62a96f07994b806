"""Metrics of text-to-motion as pure functions on numpy arrays: retrieval, distributions, intervals."""
