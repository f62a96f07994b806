"""Constraints: motions that follow a path of the root, take a pose at a frame, or bring a hand or foot to a place."""
