"""Retarget motion onto the rigs of other programs."""
