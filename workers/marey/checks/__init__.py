"""Kinematic checks: what a motion does, judged on its joints alone."""
