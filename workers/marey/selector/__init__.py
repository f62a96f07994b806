"""The selector: how well a motion shows the actions of its prompt, by rules on its joints.

Generation and training choose motions by it. The referee, by another author, judges what was chosen: neither imports
the other.
"""

from __future__ import annotations

from marey.selector.matching import WantedAction, match, wanted_of
from marey.selector.motion import Motion
from marey.selector.rules import RULES

__all__ = ["RULES", "Motion", "WantedAction", "match", "wanted_of"]
