"""Parts of the body that joints of a rig are mapped to.

Parts of a side begin with `left_` or `right_`. A spine has one to six joints and a neck up to three; a map holds them
as `spine1`, `spine2`, … from below, the last of which is the chest.
"""

from __future__ import annotations

SIDES = ("left", "right")
ARM = ("shoulder", "upper_arm", "lower_arm", "hand")
LEG = ("upper_leg", "lower_leg", "foot", "toes")
FINGERS = ("thumb", "index", "middle", "ring", "pinky")
FINGER_JOINTS = 4
"""A finger has up to four joints, numbered from 1; the first is the metacarpal where a rig has it."""
LIMBS = (*ARM, *LEG, *(f"{finger}{n}" for finger in FINGERS for n in range(1, FINGER_JOINTS + 1)))
MAX_SPINE, MAX_NECK = 6, 3
CENTRE = (
    "hips",
    *(f"spine{n}" for n in range(1, MAX_SPINE + 1)),
    *(f"neck{n}" for n in range(1, MAX_NECK + 1)),
    "head",
)
PARTS = (*CENTRE, *(f"{side}_{part}" for side in SIDES for part in LIMBS))
"""Every part, in the order of reports."""
NEEDED = tuple(f"{side}_{part}" for side in SIDES for part in ("upper_leg", "lower_leg", "foot"))
"""Parts without which no motion can be put on a rig."""


def sided(side: int | str, part: str) -> str:
    """Return the name of a part of a side: 0 or `left`, 1 or `right`."""
    return f"{side if isinstance(side, str) else SIDES[side]}_{part}"
