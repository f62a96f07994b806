"""Which joint of a rig is which part of the body.

Parts come, in this order, from the user's map, from the file itself (VRM), from the table of the family whose names fit
best, from words in the names, and from the tree and its geometry. The spine and the neck are what lies between hips,
arms and head, whatever it is called.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast

from marey.core.errors import InvalidInput
from marey.motion.rigs.by_names import Finder
from marey.motion.rigs.parts import MAX_NECK, MAX_SPINE, NEEDED, PARTS, SIDES
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.roles import Twist, find_followers, find_twists
from marey.motion.rigs.topology import parts_by_shape
from marey.motion.rigs.tree import between, common, hangs_on


@dataclass(frozen=True, eq=False)
class JointMap:
    """The parts of a rig.

    Attributes:
        parts: joint of each part that the rig has, by the names of `marey.motion.rigs.parts`.
        how: source of each part: `map`, `file`, a family's name, `words`, `tree` or `shape`.
        family: the family whose names fit best, or None.
        twists: joints that take a share of the twist of a limb.
        follows: joints that have the place and turn of a part: `ik_foot_l` of the left foot.
        controls: joints that steer others or end a chain; they keep their rest pose.
        root: a bone over the hips that travel can be put on, or None.
    """

    parts: Mapping[str, int]
    how: Mapping[str, str] = field(repr=False)
    family: str | None = None
    twists: Mapping[int, Twist] = field(default_factory=dict[int, Twist], repr=False)
    follows: Mapping[int, str] = field(default_factory=dict[int, str], repr=False)
    controls: frozenset[int] = frozenset()
    root: int | None = None

    @property
    def spine(self) -> tuple[int, ...]:
        """Joints of the spine from below; the last one is the chest."""
        return tuple(self.parts[f"spine{n}"] for n in range(1, MAX_SPINE + 1) if f"spine{n}" in self.parts)

    @property
    def neck(self) -> tuple[int, ...]:
        """Joints of the neck from below, without the head."""
        return tuple(self.parts[f"neck{n}"] for n in range(1, MAX_NECK + 1) if f"neck{n}" in self.parts)

    @property
    def chest(self) -> int:
        """The joint that carries the arms."""
        return self.spine[-1] if self.spine else self.parts["hips"]


def map_joints(rig: Rig, given: Mapping[str, str | None] | None = None, *, where: str | None = None) -> JointMap:
    """Find the parts of a rig.

    Args:
        rig: the rig.
        given: name of the joint of some parts, which override what is found; None = the rig has no such part.
        where: names the map in errors.

    Raises:
        InvalidInput: a map names unknown parts or joints, no hips or such that the legs do not hang on, or an arm or a
            head on a leg; or the rig has no legs.
    """
    where = where or "map"
    fixed = _given(rig, given or {}, where)
    finder = Finder(rig)
    parts, how, family = finder.parts()
    if any(part not in parts for part in NEEDED):
        for part, joint in parts_by_shape(rig, finder.controls).items():
            if part not in parts and joint not in parts.values():
                parts[part], how[part] = joint, "shape"
    for part, joint in fixed.items():
        parts = {each: other for each, other in parts.items() if each != part and other != joint}
        if joint is not None:
            parts[part], how[part] = joint, "map"
    _need(parts, rig, {part for part, joint in fixed.items() if joint is None})
    _off_the_legs(parts, rig, fixed, where)
    _add_trunk(rig, parts, how, fixed, where)
    for part in [part for part in parts if fixed.get(part, 0) is None]:
        del parts[part]
    ordered = {part: parts[part] for part in PARTS if part in parts}
    return JointMap(
        parts=ordered,
        how={part: how[part] for part in ordered},
        family=family,
        twists=find_twists(rig, ordered, finder.words),
        follows=find_followers(rig, ordered, finder.words),
        controls=finder.controls,
        root=_root(rig, ordered["hips"]),
    )


def _given(rig: Rig, given: Mapping[str, str | None], where: str) -> dict[str, int | None]:
    fixed: dict[str, int | None] = {}
    for part, name in given.items():
        if part not in PARTS:
            raise InvalidInput(
                f"{part!r} is not a part of the body", where=where, hint=f"Known: {', '.join(PARTS[:12])} …"
            )
        if name is not None and name not in rig.joint_names:
            raise InvalidInput(
                f"{part}: the rig has no joint {name!r}", where=where, hint="`marey rigs show FILE` lists its joints."
            )
        if part == "hips" and name is None:
            raise InvalidInput(
                "no rig is without hips", where=where, hint="Name their joint, or leave them out of the map."
            )
        fixed[part] = None if name is None else rig.index(name)
    used = [joint for joint in fixed.values() if joint is not None]
    if len(set(used)) < len(used):
        raise InvalidInput("gives one joint to two parts", where=where)
    return fixed


def _need(parts: Mapping[str, int], rig: Rig, absent: set[str]) -> None:
    """Check that the rig has legs, below the hips and in order."""
    missing = [part for part in NEEDED if part not in parts or part in absent]
    if missing:
        raise InvalidInput(
            f"no joint found for {', '.join(part.replace('_', ' ') for part in missing)}",
            where=rig.name,
            hint="Name the joints in a map: marey rigs show FILE --map MAP.json.",
        )
    for side in SIDES:
        upper, lower, foot = (parts[f"{side}_{part}"] for part in ("upper_leg", "lower_leg", "foot"))
        if not (hangs_on(rig.parents, lower, upper) and hangs_on(rig.parents, foot, lower)):
            raise InvalidInput(
                f"the joints of the {side} leg do not hang on each other: "
                + ", ".join(rig.joint_names[joint] for joint in (upper, lower, foot)),
                where=rig.name,
                hint="Name the joints in a map: marey rigs show FILE --map MAP.json.",
            )


def _off_the_legs(parts: dict[str, int], rig: Rig, fixed: Mapping[str, int | None], where: str) -> None:
    """Leave out arms and a head that were found on a leg; refuse those that a map names there."""
    legs = [parts[f"{side}_upper_leg"] for side in SIDES]
    for part in ("left_upper_arm", "right_upper_arm", "head"):
        if part in parts and any(hangs_on(rig.parents, parts[part], leg) for leg in legs):
            if fixed.get(part) is not None:
                raise InvalidInput(f"{part}: {rig.joint_names[parts[part]]!r} hangs on a leg", where=where)
            del parts[part]


def _add_trunk(
    rig: Rig, parts: dict[str, int], how: dict[str, str], fixed: Mapping[str, int | None], where: str
) -> None:
    """Add hips, spine, neck and shoulders, which follow from the tree."""
    arms = [parts[f"{side}_upper_arm"] for side in SIDES if f"{side}_upper_arm" in parts]
    legs = [parts[f"{side}_upper_leg"] for side in SIDES]
    upper = arms + ([parts["head"]] if "head" in parts else [])
    hips = common(rig.parents, legs + upper)
    if hips < 0 or hips in legs:
        raise InvalidInput("the legs do not hang on one joint", where=rig.name)
    if fixed.get("hips") is None and hips != parts.get("hips"):
        parts["hips"], how["hips"] = hips, "tree"
    if not all(hangs_on(rig.parents, leg, parts["hips"]) for leg in legs):
        raise InvalidInput(
            f"the legs do not hang on the hips {rig.joint_names[parts['hips']]!r}",
            where=where,
            hint=f"Leave the hips out of the map: {rig.joint_names[hips]!r} is found.",
        )
    chest = common(rig.parents, arms if len(arms) == 2 else upper)
    for number, joint in enumerate(_up_to(rig, parts["hips"], chest)[:MAX_SPINE], start=1):
        _add(parts, how, f"spine{number}", joint)
    if "head" in parts and chest >= 0:
        for number, joint in enumerate(between(rig.parents, chest, parts["head"])[:MAX_NECK], start=1):
            _add(parts, how, f"neck{number}", joint)
    for side in SIDES:
        arm, part = parts.get(f"{side}_upper_arm"), f"{side}_shoulder"
        over = between(rig.parents, chest, arm) if arm is not None and chest >= 0 else []
        if parts.get(part) not in over:
            parts.pop(part, None)
            if over:
                _add(parts, how, part, over[-1])


def _up_to(rig: Rig, hips: int, chest: int) -> list[int]:
    """Return the joints over the hips up to the chest, at most `MAX_SPINE`: of more, the lowest and the highest."""
    if chest < 0 or not hangs_on(rig.parents, chest, hips):
        return []
    found = [*between(rig.parents, hips, chest), chest]
    return found if len(found) <= MAX_SPINE else [*found[: MAX_SPINE - 1], found[-1]]


def _add(parts: dict[str, int], how: dict[str, str], part: str, joint: int) -> None:
    if part not in parts:
        for other in [each for each, taken in parts.items() if taken == joint]:
            del parts[other]
        parts[part], how[part] = joint, "tree"


def _root(rig: Rig, hips: int) -> int | None:
    """Return the topmost bone over the hips."""
    joint, found = rig.parents[hips], None
    while joint >= 0:
        found = joint if rig.bones[joint] else found
        joint = rig.parents[joint]
    return found


def read_map(document: Any, where: str) -> dict[str, str | None]:
    """Return the map of a JSON document: an object of parts and names of joints, null for a part that is not there.

    Raises:
        InvalidInput: it is something else.
    """
    given = cast("Mapping[Any, Any]", document) if isinstance(document, dict) else {1: 1}
    if not all(isinstance(part, str) and (name is None or isinstance(name, str)) for part, name in given.items()):
        raise InvalidInput(
            "is not an object of parts and joint names", where=where, hint='Such as {"left_hand": "Hand_L"}.'
        )
    return dict(given)
