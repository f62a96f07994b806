"""Rigs of other programs: their joints and rest pose, and which joint is which part of the body."""
