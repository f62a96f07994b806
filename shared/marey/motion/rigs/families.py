"""Names of joints in the rigs of common programs, as tables.

A name is compared in lower case without its namespace and without separators. `{s}` stands for the side, in the
family's spelling; `#` for a number from the one named on. Sources: the files of `verified.md`, and the published
skeletons of Adobe Mixamo, Epic's mannequins, Autodesk HumanIK, Blender Rigify, VRM 1.0, Daz Genesis 8 and Poser 4, the
CMU database (asf names and the cgspeed conversion), Reallusion iClone, Bandai-Namco, SMPL.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from marey.motion.rigs.parts import FINGERS, SIDES, sided


@dataclass(frozen=True)
class Family:
    """The joint names of one family of rigs.

    Attributes:
        name: such as `mixamo`.
        names: normalized joint name to part; `spine` and `neck` parts are left out, the tree gives them.
    """

    name: str
    names: dict[str, str] = field(repr=False)


def normalize(name: str) -> str:
    """Return a joint name as families spell it: without namespace, separators and capitals."""
    name = re.sub(r"[^a-z0-9]", "", re.split(r"[:|]", name)[-1].lower())
    return re.sub(r"^(mixamorig\d*|ccbase|def|bip0*1|jbip[clr](?=[a-z]))(?=.)", "", name)


def _family(name: str, sides: tuple[str, str], fingers: str, table: str, first: int = 1) -> Family:
    """Return a family of a table: lines of a part and its names; `fingers` is the pattern of finger joints, with the
    finger's name as `{f}`, numbered from `first`."""
    names: dict[str, str] = {}
    for line in table.strip().splitlines():
        part, *spelled = line.split()
        for each in spelled:
            if "{s}" not in each:
                names[each] = part
                continue
            for side, spelling in zip(SIDES, sides, strict=True):
                names[each.replace("{s}", spelling)] = sided(side, part)
    for side, spelling in zip(SIDES, sides, strict=True):
        for finger in FINGERS if fingers else ():
            for number in range(1, 4):
                for called in _CALLED[finger]:
                    spelled = fingers.format(s=spelling, f=called, n=number - 1 + first)
                    names.setdefault(spelled, f"{side}_{finger}{number}")
    return Family(name, names)


_CALLED = {
    "thumb": ("thumb",),
    "index": ("index", "findex"),
    "middle": ("middle", "mid", "fmiddle"),
    "ring": ("ring", "fring"),
    "pinky": ("pinky", "little", "fpinky"),
}

_SMPL = """
        hips pelvis
        head head
        shoulder {s}collar
        upper_arm {s}shoulder
        lower_arm {s}elbow
        hand {s}wrist
        upper_leg {s}hip
        lower_leg {s}knee
        foot {s}ankle
        toes {s}foot
    """
"""Names of SMPL and SMPL-X, which differ in their words for the sides, and in the fingers."""

FAMILIES: tuple[Family, ...] = (
    _family("mixamo", ("left", "right"), "{s}hand{f}{n}", """
        hips hips
        head head
        shoulder {s}shoulder
        upper_arm {s}arm
        lower_arm {s}forearm
        hand {s}hand
        upper_leg {s}upleg
        lower_leg {s}leg
        foot {s}foot
        toes {s}toebase
    """),
    _family("unreal", ("l", "r"), "{f}0{n}{s}", """
        hips pelvis
        head head
        shoulder clavicle{s}
        upper_arm upperarm{s}
        lower_arm lowerarm{s}
        hand hand{s}
        upper_leg thigh{s}
        lower_leg calf{s}
        foot foot{s}
        toes ball{s}
    """),
    _family("rigify", ("l", "r"), "{f}0{n}{s}", """
        hips hips spine
        head head spine006
        shoulder shoulder{s}
        upper_arm upperarm{s}
        lower_arm forearm{s}
        hand hand{s}
        upper_leg thigh{s}
        lower_leg shin{s}
        foot foot{s}
        toes toe{s}
    """),
    _family("vrm", ("left", "right"), "", """
        hips hips
        head head
        shoulder {s}shoulder
        upper_arm {s}upperarm
        lower_arm {s}lowerarm
        hand {s}hand
        upper_leg {s}upperleg
        lower_leg {s}lowerleg
        foot {s}foot
        toes {s}toes {s}toebase
        thumb1 {s}thumbmetacarpal {s}thumb1
        thumb2 {s}thumbproximal {s}thumb2
        thumb3 {s}thumbdistal {s}thumb3
        index1 {s}indexproximal {s}index1
        index2 {s}indexintermediate {s}index2
        index3 {s}indexdistal {s}index3
        middle1 {s}middleproximal {s}middle1
        middle2 {s}middleintermediate {s}middle2
        middle3 {s}middledistal {s}middle3
        ring1 {s}ringproximal {s}ring1
        ring2 {s}ringintermediate {s}ring2
        ring3 {s}ringdistal {s}ring3
        pinky1 {s}littleproximal {s}little1
        pinky2 {s}littleintermediate {s}little2
        pinky3 {s}littledistal {s}little3
    """),
    _family("daz", ("l", "r"), "{s}{f}{n}", """
        hips hip
        head head
        shoulder {s}collar
        upper_arm {s}shldr {s}shldrbend
        lower_arm {s}forearm {s}forearmbend
        hand {s}hand
        upper_leg {s}thigh {s}thighbend
        lower_leg {s}shin
        foot {s}foot
        toes {s}toe
    """),
    _family("cmu", ("l", "r"), "", """
        hips root
        head head
        shoulder {s}clavicle
        upper_arm {s}humerus
        lower_arm {s}radius
        hand {s}wrist
        upper_leg {s}femur
        lower_leg {s}tibia
        foot {s}foot
        toes {s}toes
        thumb1 {s}thumb
    """),
    _family("bandai-namco", ("l", "r"), "", """
        hips hips
        head head
        shoulder shoulder{s}
        upper_arm upperarm{s}
        lower_arm lowerarm{s}
        hand hand{s}
        upper_leg upperleg{s}
        lower_leg lowerleg{s}
        foot foot{s}
        toes toes{s}
    """),
    _family("iclone", ("l", "r"), "{s}{f}{n}", """
        hips hip
        head head
        shoulder {s}clavicle
        upper_arm {s}upperarm
        lower_arm {s}forearm
        hand {s}hand
        upper_leg {s}thigh
        lower_leg {s}calf
        foot {s}foot
        toes {s}toebase
    """),
    _family("smpl", ("l", "r"), "", _SMPL),
    _family("smplx", ("left", "right"), "{s}{f}{n}", _SMPL),
    _family("snapmogen", ("l", "r"), "", """
        hips root
        head cheadbindjnt
        shoulder {s}claviclebindjnt
        upper_arm {s}armupper0001bindjnt
        lower_arm {s}armlower0001bindjnt
        hand {s}hand0001bindjnt
        upper_leg {s}legupper0001bindjnt
        lower_leg {s}leglower0001bindjnt
        foot {s}foot0001bindjnt
        toes {s}foot0002bindjnt
    """),
    _family("kit", ("l", "r"), "", """
        hips root
        head bun
        upper_arm {s}s
        lower_arm {s}e
        hand {s}w
        upper_leg {s}h
        lower_leg {s}k
        foot {s}a
        toes {s}f
    """),
)  # fmt: skip


def best_family(names: Sequence[str]) -> tuple[Family, dict[str, int]] | None:
    """Return the family with most parts among these joint names, and the joint of each; None if it has less than the
    legs, the arms and a head.

    The first of several joints with one name counts.
    """
    spelled = [normalize(name) for name in names]
    best: tuple[Family, dict[str, int]] | None = None
    for family in FAMILIES:
        found: dict[str, int] = {}
        for joint, name in enumerate(spelled):
            if name in family.names:
                found.setdefault(family.names[name], joint)
        if len(found) >= ENOUGH and (best is None or len(found) > len(best[1])):
            best = family, found
    return best


ENOUGH = 14
"""Parts of a body with hips, head, two arms and two legs."""
