"""Retarget motion onto the rigs of other programs."""

from marey.motion.retarget.apply import on_body
from marey.motion.retarget.load import load_body
from marey.motion.retarget.retarget import retarget
from marey.motion.retarget.source import source_of, source_on
from marey.motion.retarget.write import write_rigged

__all__ = ["load_body", "on_body", "retarget", "source_of", "source_on", "write_rigged"]
