"""Units and axes of files. All code inside uses metres and Y up."""

from __future__ import annotations

from typing import Literal

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
Unit = Literal["m", "cm", "mm", "in", "ft"]
Up = Literal["y", "z"]
FARTHEST = 1e6
"""Metres from the origin to a joint; of numbers beyond it nothing could be computed."""
