"""Damaged FBX files: flipped bytes, cut ends, changed counts. Nothing but Marey's errors comes out."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest

from marey.core.errors import InvalidFile, TooLarge
from marey.motion.io.fbx_read import parse_fbx
from marey.motion.io.fbx_write import format_fbx
from marey.motion.io.rig_fbx import parse_fbx_rig
from tests.support.archives import archive
from tests.support.fbx import rewritten
from tests.support.walker import walker

OURS = format_fbx(walker(seconds=0.1))
FILES = {
    "ours": lambda: OURS,
    "ours, FBX 7.5, packed": lambda: rewritten(OURS, 7500, packed=True),
    "Maya": lambda: archive("rigs/maya_human_ik_7400_binary.fbx").read_bytes(),
    "Poser": lambda: archive("rigs/91_48.fbx").read_bytes(),
}
NUMBERS = (0, 1, 2**16, 2**31 - 1, 2**31, 2**32 - 1)


def damaged(data: bytes, random: np.random.Generator) -> bytes:
    kind = random.integers(4)
    if kind == 0:
        return data[: random.integers(len(data))]
    changed = bytearray(data)
    if kind == 1:
        for at in random.integers(27, len(data), random.integers(1, 20)):
            changed[at] = random.integers(256)
    elif kind == 2:  # a count, a size or an offset
        at = int(random.integers(27, len(data) - 4))
        changed[at : at + 4] = int(random.choice(NUMBERS)).to_bytes(4, "little")
    else:  # a piece twice, or left out
        at, size = int(random.integers(27, len(data))), int(random.integers(1, 200))
        changed[at : at + size] = changed[at : at + size] * 2 if random.random() < 0.5 else b""
    return bytes(changed)


def read_damaged(name: str, count: int, seed: int) -> None:
    data, random = FILES[name](), np.random.default_rng(seed)
    for _ in range(count):
        bad = damaged(data, random)
        for read in (parse_fbx, parse_fbx_rig):
            with suppress(InvalidFile, TooLarge):
                read(bad, "a.fbx")


@pytest.mark.parametrize("name", ["ours", "ours, FBX 7.5, packed"])
def test_damaged_files_are_refused_or_read(name: str) -> None:
    read_damaged(name, 60, 1)


@pytest.mark.data
@pytest.mark.parametrize("name", ["Maya", "Poser"])
def test_damaged_files_of_other_programs_are_refused_or_read(name: str) -> None:
    read_damaged(name, 20, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_ten_thousand_damaged_files(name: str) -> None:
    read_damaged(name, 2500, 2)
