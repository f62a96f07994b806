"""GIF: a film of the motion, which every program shows."""

from __future__ import annotations

from marey.exporters.animated import animated

EXPORTER = animated("gif")
