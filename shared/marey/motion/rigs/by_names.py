"""Find the parts of a rig by the names of its joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from marey.motion.rigs.families import best_family
from marey.motion.rigs.parts import FINGER_JOINTS, FINGERS, SIDES, sided
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.tree import above, between, hangs_on
from marey.motion.rigs.words import CONTROL, ENDS, TWISTS, read_names

# In order of confidence: `shoulder` is the upper arm in SMPL and the collar bone elsewhere, `hip` the thigh in some.
LIMB_WORDS: dict[str, tuple[str, ...]] = {
    "upper_leg": ("upleg", "upperleg", "thigh", "thighbend", "legupper", "femur", "hip"),
    "lower_leg": ("lowerleg", "lowleg", "calf", "shin", "leglower", "tibia", "knee", "leg"),
    "foot": ("ankle", "foot"),
    "toes": ("toebase", "toes", "toe", "ball", "metatarsals", "foot"),
    "upper_arm": ("upperarm", "uparm", "armupper", "humerus", "shldr", "shldrbend", "arm", "shoulder"),
    "lower_arm": ("lowerarm", "lowarm", "forearm", "forearmbend", "armlower", "radius", "elbow"),
    "hand": ("wrist", "hand", "palm"),
    "shoulder": ("clavicle", "collar", "collarbone", "shoulder"),
}
UNDER = {"lower_leg": "upper_leg", "foot": "lower_leg", "toes": "foot", "lower_arm": "upper_arm", "hand": "lower_arm"}
FINGER_WORDS = {
    "thumb": ("thumb",), "index": ("index",), "middle": ("mid",), "ring": ("ring",), "pinky": ("pinky", "little"),
}  # fmt: skip
VRM = {
    "upperArm": "upper_arm", "lowerArm": "lower_arm", "hand": "hand", "shoulder": "shoulder",
    "upperLeg": "upper_leg", "lowerLeg": "lower_leg", "foot": "foot", "toes": "toes",
}  # fmt: skip
"""Parts of a side in VRM, without `left` or `right`."""


class Finder:
    """The names of a rig.

    Attributes:
        words: names in parts.
        controls: joints that steer others, end a chain, or are no bones.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.words = read_names(rig.joint_names)
        self.controls = frozenset(
            joint
            for joint, word in enumerate(self.words)
            if not rig.bones[joint] or word.words & CONTROL or (word.words & ENDS and not rig.children[joint])
        )
        self._no_part = self.controls | {j for j, word in enumerate(self.words) if word.words & TWISTS}

    def parts(self) -> tuple[dict[str, int], dict[str, str], str | None]:
        """Return the joint of each part, how it was found, and the family."""
        parts: dict[str, int] = {}
        how: dict[str, str] = {}

        def add(found: Mapping[str, int], source: str) -> None:
            for part, joint in found.items():
                if part not in parts and joint not in parts.values():
                    parts[part], how[part] = joint, source

        add(self._of_file(), "file")
        family = best_family(self.rig.joint_names)
        if family is not None:
            add({part: joint for part, joint in family[1].items() if joint not in self._no_part}, family[0].name)
        add(self._by_words(parts), "words")
        for side in SIDES:
            if f"{side}_hand" in parts:
                fingers = self._fingers(parts[f"{side}_hand"])
                parts = {part: joint for part, joint in parts.items() if not _is_finger(part, side)}
                for part, joint in fingers.items():
                    parts[f"{side}_{part}"] = joint
                    how.setdefault(f"{side}_{part}", "words")
            wrist = self._wrist(parts, side)
            if wrist is not None:
                parts[f"{side}_hand"], how[f"{side}_hand"] = wrist, "words"
            if f"{side}_foot" in parts and f"{side}_toes" not in parts:
                add({f"{side}_toes": joint for joint in self._toes(parts[f"{side}_foot"])}, "tree")
        return parts, how, None if family is None else family[0].name

    def _of_file(self) -> dict[str, int]:
        """Return the parts that a VRM file states."""
        stated = cast("Mapping[str, int]", self.rig.extras.get("humanoid", {}))
        order = cast("list[int]", self.rig.extras.get("order", []))
        found: dict[str, int] = {}
        for name, node in stated.items():
            side = next((each for each in SIDES if name.startswith(each)), None)
            part = name if side is None else VRM.get(name[len(side) :][:1].lower() + name[len(side) + 1 :])
            if part in ("hips", "head") or (side is not None and part is not None):
                found[part if side is None else f"{side}_{part}"] = order.index(node)
        return found

    def _by_words(self, known: Mapping[str, int]) -> dict[str, int]:
        """Return the parts whose names say what they are; those of a limb hang on each other."""
        found = {part: joint for part in ("hips", "head") for joint in self._named(None, part, (part,), None)[:1]}
        for side in range(2):
            for part, spelled in LIMB_WORDS.items():
                name = sided(side, part)
                over = sided(side, UNDER[part]) if part in UNDER else None
                upper = None if over is None else known.get(over, found.get(over))
                taken = {*known.values(), *found.values()}
                if name in known or (over is not None and upper is None):
                    continue
                free = [joint for joint in self._named(side, part, spelled, upper) if joint not in taken]
                if free:
                    found[name] = free[0]
        return found

    def _named(self, side: int | None, part: str, spelled: tuple[str, ...], upper: int | None) -> list[int]:
        """Return the joints of one side whose word is one of these, the most confident first, under a joint."""
        return [
            joint
            for each in spelled
            for joint, word in enumerate(self.words)
            if word.side == side
            and word.word == each
            and joint not in self._no_part
            and (upper is None or hangs_on(self.rig.parents, joint, upper))
        ]

    def _fingers(self, hand: int) -> dict[str, int]:
        """Return the joints of the fingers below a hand, numbered from the palm."""
        found: dict[str, int] = {}
        below = [
            joint
            for joint in range(len(self.rig))
            if joint not in self._no_part and hangs_on(self.rig.parents, joint, hand)
        ]
        for finger in FINGERS:
            joints = [joint for joint in below if any(each in self.words[joint].word for each in FINGER_WORDS[finger])]
            joints.sort(key=lambda joint: len(above(self.rig.parents, joint)))
            found.update({f"{finger}{n}": joint for n, joint in enumerate(joints[:FINGER_JOINTS], start=1)})
        return found

    def _wrist(self, parts: Mapping[str, int], side: str) -> int | None:
        """Return a joint named wrist between the lower arm and what is called the hand."""
        arm, hand = parts.get(f"{side}_lower_arm"), parts.get(f"{side}_hand")
        if arm is None or hand is None:
            return None
        return next((j for j in between(self.rig.parents, arm, hand) if self.words[j].word == "wrist"), None)

    def _toes(self, foot: int) -> list[int]:
        """Return the only child of a foot that is no helper."""
        below = [joint for joint in self.rig.children[foot] if joint not in self._no_part]
        return below if len(below) == 1 else []


def _is_finger(part: str, side: str) -> bool:
    return part.removeprefix(f"{side}_")[:-1] in FINGERS
