"""The posture in which a movement of a sequence begins, is done and ends."""

from __future__ import annotations

from dataclasses import dataclass

from marey.drawing.holds import KNEES
from marey.drawing.low_deeds import LowDeed


@dataclass(frozen=True)
class RowPosture:
    """Postures of a row of a timeline, by their names in `marey.drawing.holds`; empty = on the feet, or the network's.

    Attributes:
        begin: in which the row before has left the body.
        own: in which the movement is done, or which it comes to.
        end: in which the row after begins.
        gesture: the movement is one of arms, head and trunk, made by itself and put onto the posture.
        enters: in which a movement begins that is drawn by itself, if the body is low before it; empty = it is not.
        apart: the row before ends otherwise than this one begins.
        falls: the movement comes to its posture by itself.
        fires: shots go off in the posture.
        leaves: in which a movement ends that is drawn by itself; empty = on the feet, or in `own`.
        deed: what the hands do in the posture, with or on what lies there.
        halves: half turns of a body that lies and rolls over; 0 = as many as lie between two postures.
        rolls_to: left or right, to which it rolls; empty = the shorter way.
        seed: of all rows, so that they meet in the same posture.
    """

    begin: str = ""
    own: str = ""
    end: str = ""
    gesture: bool = False
    enters: str = ""
    apart: bool = False
    falls: bool = False
    fires: bool = False
    leaves: str = ""
    deed: LowDeed | None = None
    halves: int = 0
    rolls_to: str = ""
    seed: int = 0

    @property
    def meets(self) -> bool:
        """True if the row before it ends in its posture, and nothing is to be generated between the two."""
        return bool(self.begin or self.enters) and not self.apart

    @property
    def is_drawn(self) -> bool:
        """True if the whole movement is a change of posture, or a wait in one."""
        return bool(self.begin or self.own) and not (self.gesture or self.falls)

    @property
    def comes_to(self) -> str:
        """Name of the posture in which the body is behind the movement, before it goes on to `end`."""
        return self.own or self.leaves

    @property
    def goes_on(self) -> bool:
        """True if a movement that is drawn by itself ends in another posture than the next one begins in."""
        low = self.own if self.falls else self.leaves
        return bool(low) and (self.end != low or low == KNEES)  # who drops to the knees is slumped

    @property
    def carries(self) -> bool:
        """True if the movement is put onto a posture."""
        return self.gesture and bool(self.own)


NO_POSTURE = RowPosture()
"""Of a row that begins and ends on its feet, and of a motion that is no row."""
