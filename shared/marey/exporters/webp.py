"""WebP: a film of the motion, smaller than a GIF."""

from __future__ import annotations

from marey.exporters.animated import animated

EXPORTER = animated("webp")
