"""Find hips, shoulders and feet in a foreign rig by its joint names.

Names are split into words (`CC_Base_L_ToeBase` is cc base l toe base), their side is detected, and the remaining words
are looked up among those of common rigs: Mixamo, Unreal, MotionBuilder, iClone, Bandai-Namco, LaFAN1, SMPL, Rigify.
"""

from __future__ import annotations

import re

from marey.motion.skeleton import Skeleton

_KINDS = frozenset({"bind", "jnt", "joint"})  # Maya's rigs say what a node is, as in `L_foot0001_bind_JNT`
_SIDES = {"l": 0, "left": 0, "r": 1, "right": 1}
# In order of confidence: `shoulder` is the upper arm in SMPL and the collar bone elsewhere, `hip` the thigh in some.
_PARTS = {
    "thigh": ("up leg", "upper leg", "thigh", "leg upper", "hip"),
    "ankle": ("ankle", "foot"),
    "toe": ("toe base", "toes", "toe", "ball", "foot"),
    "arm": ("upper arm", "uparm", "arm upper", "arm", "shoulder"),
}


def _words(name: str) -> tuple[int | None, str]:
    """Return the side (0 left, 1 right, None) of a joint's name, and its other words without numbers."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name.rsplit(":", 1)[-1])
    words = [w for w in re.split(r"[^a-z]+", name.lower()) if w]
    words = [w for w in words if w not in _KINDS]
    words = " ".join(words).replace("upperarm", "upper arm").replace("upleg", "up leg").replace("upperleg", "upper leg")
    words = words.replace("toebase", "toe base").replace("forearm", "fore-arm").split()
    side = next((_SIDES[w] for w in words if w in _SIDES), None)
    return side, " ".join(w for w in words if w not in _SIDES)


def _find(skeleton: Skeleton, part: str, below: int | None, side: int) -> int | None:
    """Return the first joint of one side whose name ends in one of the part's words, under the joint `below`."""
    named = [_words(n) for n in skeleton.joint_names]
    for words in _PARTS[part]:
        for j, (its_side, rest) in enumerate(named):
            exact = re.search(rf"(^| ){words}$", rest) is not None
            if its_side == side and exact and (below is None or _hangs_on(skeleton, j, below)):
                return j
    return None


def _hangs_on(skeleton: Skeleton, j: int, above: int) -> bool:
    while j >= 0 and j != above:
        j = skeleton.parents[j]
    return j == above


def feet_and_facing(skeleton: Skeleton) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Find the feet (L ankle, L toe, R ankle, R toe) and facing joints (r_hip, l_hip, r_shoulder, l_shoulder) of a
    skeleton.

    Each is empty if any of its joints is not found; a toe must be below its ankle, and an ankle below its thigh.
    """
    thighs = [_find(skeleton, "thigh", None, side) for side in (0, 1)]
    arms = [_find(skeleton, "arm", None, side) for side in (0, 1)]
    feet: list[int | None] = []
    for side, thigh in enumerate(thighs):
        ankle = None if thigh is None else _find(skeleton, "ankle", thigh, side)
        toe = None if ankle is None else _find(skeleton, "toe", ankle, side)
        if ankle is not None and toe == ankle:  # one joint of that name: its child is the toe
            toe = next(iter(skeleton.children[ankle]), None)
        feet += [ankle, toe]
    return _all(feet), _all([thighs[1], thighs[0], arms[1], arms[0]])


def _all(joints: list[int | None]) -> tuple[int, ...]:
    found = tuple(j for j in joints if j is not None)
    return found if len(found) == len(joints) else ()
