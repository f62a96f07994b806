"""Retarget motion onto the rigs of other programs."""

from marey.core.lazy import lazy_names
from marey.motion.retarget.apply import on_body
from marey.motion.retarget.load import load_body
from marey.motion.retarget.retarget import retarget
from marey.motion.retarget.source import source_of, source_on

# The place of `write_rigged` before it wrote every format; exporters lie above this package.
__getattr__ = lazy_names(__name__, {"marey.exporters": "write_rigged"})

__all__ = ["load_body", "on_body", "retarget", "source_of", "source_on"]
