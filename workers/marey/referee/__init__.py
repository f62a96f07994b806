"""The referee: independent checks of whether a motion shows an action.

It alone gives the published adherence. It is written from the definitions of the vocabulary, shares no rule with the
checks by which motions are chosen (best of N, self-training), and neither training nor generation imports it.
"""

from __future__ import annotations

from marey.referee import aerial, combat, exercises, gaits, gestures, postures
from marey.referee.body import Body
from marey.referee.rules import RULES
from marey.referee.sequences import shows, shows_in_order

__all__ = ["RULES", "Body", "aerial", "combat", "exercises", "gaits", "gestures", "postures", "shows", "shows_in_order"]
