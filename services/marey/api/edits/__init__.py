"""Edits of stored motions."""
