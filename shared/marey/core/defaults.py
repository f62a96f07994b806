"""Defaults of settings that code without pydantic needs too: the client, and the reference documentation."""

from __future__ import annotations

MODEL = "hgm3"
"""`MAREY_DEFAULT_MODEL`: the model of items that name none."""
