"""Movements that are drawn on a body: for the made clips of training data, and in motions that a network made."""
