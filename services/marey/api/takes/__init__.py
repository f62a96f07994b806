"""Motions and their files."""
