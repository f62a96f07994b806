"""Defaults of settings that code without pydantic needs too: the client's, and those that stand in the reference."""

from __future__ import annotations

MODEL = "hgm3"
"""`MAREY_DEFAULT_MODEL`: the model of items that name none."""
LIVE_MODEL = "mogo"
"""`MAREY_LIVE_MODEL`: the model of live streams that name none."""
