"""Names of joints, read as words: `mixamorig:LeftUpLeg`, `DEF-upper_arm.L.001`, `CC_Base_L_Mid1`, `lShldrBend`.

A name gives a side, a word without it (`upleg`, `upperarm`, `mid`, `shldrbend`), and a number.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

_SIDES = {"l": 0, "left": 0, "lft": 0, "r": 1, "right": 1, "rgt": 1}
_KINDS = frozenset(
    {"bind", "jnt", "joint", "bone", "def", "b", "base", "bip", "bip01", "bip001", "cc", "c", "j", "mixamorig"}
)
"""Words that say what a node is, not where."""
_HEAD = re.compile(r".{2,12}?[_\-. ](?=.*[A-Za-z])")
"""A beginning of a name that more words follow."""
_LETTER = re.compile(r"([lr])(?=[A-Z][a-z])|([lr])(?=[a-z])")
CONTROL = frozenset(
    [
        "effector",
        "ik",
        "fk",
        "ctrl",
        "ctl",
        "control",
        "controller",
        "target",
        "pole",
        "goal",
        "poletarget",
        "mch",
        "org",
        "aux",
        "null",
        "locator",
    ]
)
"""Words of joints that steer others and are no part of the body."""
ENDS = frozenset(["end", "nub", "tip", "leaf", "site", "endsite"])
TWISTS = frozenset(["twist", "roll", "tweak"])


@dataclass(frozen=True)
class NameWord:
    """A joint's name in parts.

    Attributes:
        side: 0 left, 1 right, None in the middle or unknown.
        word: the words without side and number, in lower case, joined.
        number: its last number, 0 without one.
        words: the single words, with the side.
    """

    side: int | None
    word: str
    number: int
    words: frozenset[str]


def read_names(names: Sequence[str]) -> list[NameWord]:
    """Read the names of all joints of a rig; a letter before a word is a side where the other side has it too."""
    bare = _without_prefix([name.rsplit(":", 1)[-1].rsplit("|", 1)[-1] for name in names])
    known = set(bare)
    return [_read(name, known) for name in bare]


def _without_prefix(names: list[str]) -> list[str]:
    """Return names without the beginning that most of them share, such as `CC_Base_` or `DEF-`."""
    while True:
        heads = Counter(found.group() for name in names if (found := _HEAD.match(name)))
        head, count = heads.most_common(1)[0] if heads else ("", 0)
        if count <= 0.6 * len(names) or head.strip("_-. ").lower() in _SIDES:
            return names
        names = [name.removeprefix(head) for name in names]


def _read(name: str, known: set[str]) -> NameWord:
    words = split(name)
    side = next((_SIDES[word] for word in words if word in _SIDES), None)
    if side is None and (found := _LETTER.match(name)) and name[0] in "lr":
        other = ("r" if name[0] == "l" else "l") + name[1:]
        if other in known:
            side, words = _SIDES[found.group()], ["l" if name[0] == "l" else "r", *split(name[1:])]
    rest = [word for word in words if word not in _SIDES]
    plain = [word for word in rest if not word.isdigit() and word not in _KINDS]
    digits = [word for word in rest if word.isdigit()]
    return NameWord(side, "".join(plain or rest), int(digits[-1][-4:]) if digits else 0, frozenset(words))


def split(name: str) -> list[str]:
    """Split a name into words and numbers, in lower case."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=\d)|(?<=\d)(?=[A-Za-z])", " ", name)
    return [word for word in re.split(r"[^a-z0-9]+", parted.lower()) if word]
