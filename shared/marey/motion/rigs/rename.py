"""Names of joints in the spelling of other programs."""

from __future__ import annotations

from functools import lru_cache

from marey.core.errors import InvalidInput
from marey.motion.export_options import Names
from marey.motion.rigs.landmarks import map_names
from marey.motion.rigs.parts import FINGERS, SIDES

CENTRE: dict[Names, dict[str, str]] = {
    "mixamo": {
        "hips": "mixamorig:Hips", "spine1": "mixamorig:Spine", "spine#": "mixamorig:Spine{0}",
        "neck1": "mixamorig:Neck", "neck#": "mixamorig:Neck{0}", "head": "mixamorig:Head",
    },
    "humanik": {
        "hips": "Hips", "spine1": "Spine", "spine#": "Spine{0}", "neck1": "Neck", "neck#": "Neck{0}", "head": "Head",
    },
    "ue5": {"hips": "pelvis", "spine#": "spine_{1:02}", "neck#": "neck_{1:02}", "head": "head"},
    "smplx": {"hips": "pelvis", "spine#": "spine{1}", "neck1": "neck", "neck#": "neck{1}", "head": "head"},
    "vrm": {
        "hips": "hips", "spine1": "spine", "spine2": "chest", "spine3": "upperChest", "neck1": "neck", "head": "head",
    },
}  # fmt: skip
"""Names of the middle of the body; `{1}` is the number from 1 on, `{0}` from 0 on."""
_CAMEL = {
    "shoulder": "Shoulder", "upper_arm": "Arm", "lower_arm": "ForeArm", "hand": "Hand",
    "upper_leg": "UpLeg", "lower_leg": "Leg", "foot": "Foot", "toes": "ToeBase",
}  # fmt: skip
LIMBS: dict[Names, dict[str, str]] = {
    "mixamo": {part: f"mixamorig:{{Left}}{name}" for part, name in _CAMEL.items()},
    "humanik": {part: f"{{Left}}{name}" for part, name in _CAMEL.items()},
    "ue5": {
        "shoulder": "clavicle_{l}", "upper_arm": "upperarm_{l}", "lower_arm": "lowerarm_{l}", "hand": "hand_{l}",
        "upper_leg": "thigh_{l}", "lower_leg": "calf_{l}", "foot": "foot_{l}", "toes": "ball_{l}",
    },
    "smplx": {
        "shoulder": "{left}_collar", "upper_arm": "{left}_shoulder", "lower_arm": "{left}_elbow",
        "hand": "{left}_wrist",
        "upper_leg": "{left}_hip", "lower_leg": "{left}_knee", "foot": "{left}_ankle", "toes": "{left}_foot",
    },
    "vrm": {
        "shoulder": "{left}Shoulder", "upper_arm": "{left}UpperArm", "lower_arm": "{left}LowerArm",
        "hand": "{left}Hand",
        "upper_leg": "{left}UpperLeg", "lower_leg": "{left}LowerLeg", "foot": "{left}Foot", "toes": "{left}Toes",
    },
}  # fmt: skip
"""Names of the limbs of a side."""
FINGER: dict[Names, str] = {
    "mixamo": "mixamorig:{Left}Hand{Finger}{number}",
    "humanik": "{Left}Hand{Finger}{number}",
    "ue5": "{finger}_{number:02}_{l}",
    "smplx": "{left}_{finger}{number}",
}
"""Names of finger joints, where they follow a rule."""


@lru_cache(maxsize=64)
def renamed(joint_names: tuple[str, ...], parents: tuple[int, ...], names: Names) -> tuple[str, ...]:
    """Return the names of joints in another spelling; joints that are no part of the body keep theirs.

    Raises:
        InvalidInput: the parts of the body are not found, or two joints would have one name.
    """
    found = list(joint_names)
    for part, joint in map_names(joint_names, parents).parts.items():
        found[joint] = name_of(part, names) or found[joint]
    if len(set(found)) < len(found):
        raise InvalidInput(f"two joints would have one name in the spelling {names!r}", where="names", argument="names")
    return tuple(found)


def name_of(part: str, names: Names) -> str | None:
    """Return the name of a part of the body in a spelling, None if it has no name there."""
    side = next((each for each in SIDES if part.startswith(each)), None)
    if side is None:
        word = part.rstrip("0123456789")
        number = int(part.removeprefix(word) or 0)
        template = CENTRE[names].get(part, CENTRE[names].get(f"{word}#"))
        return None if template is None else template.format(number - 1, number)
    limb = part.removeprefix(f"{side}_")
    spelled = {"left": side, "Left": side.capitalize(), "l": side[0]}
    if limb in LIMBS[names]:
        return LIMBS[names][limb].format(**spelled)
    finger = limb[:-1]
    if finger not in FINGERS or names not in FINGER:
        return None
    return FINGER[names].format(**spelled, finger=finger, Finger=finger.capitalize(), number=int(limb[-1]))
