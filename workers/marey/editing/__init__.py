"""Edited motions: their quality and how well they show their prompt. `marey.motion.edit` makes them."""
