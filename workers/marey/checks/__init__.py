"""Kinematic checks of the actions of a motion, on its joints alone."""
