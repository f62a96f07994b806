"""Motions as programs of others open them: joints in metres, Y up, at the times of keys. See `support.clients`."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.motion.rotations import Array, multiply, rotate
from tests.support.clients import node, python


@dataclass(frozen=True)
class Opened:
    """A motion in another program.

    Attributes:
        names: of the joints there.
        joints: (T, J, 3) metres, Y up.
        times: (T,) seconds of the keys.
        rest: (J, 3) the rest pose where the program tells it.
        meshes: bones of each skinned mesh.
        points: (V, 3) of meshes in the last frame.
        empties: nodes that are no bones.
        fps: rate of the scene.
        extras: `asset.extras` of a glb.
    """

    names: Sequence[str]
    joints: Array = field(repr=False)
    times: Array = field(repr=False)
    rest: Array | None = field(default=None, repr=False)
    meshes: Sequence[int] = ()
    points: Array = field(default_factory=lambda: np.empty((0, 3)), repr=False)
    empties: int = 0
    fps: float | None = None
    extras: Any = field(default=None, repr=False)

    def check(self, names: Sequence[str], joints: Array, fps: float, *, first: int = 0) -> None:
        """Hold the joints of these names against those that were written: equal to a millimetre, at equal times.

        Args:
            first: frame of the file in which the motion begins: 1 after a T-pose.
        """
        self.check_places(names, joints, first=first)
        np.testing.assert_allclose(self.times, np.arange(first + len(joints)) / fps, atol=1e-4)

    def check_places(self, names: Sequence[str], joints: Array, *, first: int = 0) -> None:
        """Hold the joints alone, where a program moves the keys."""
        found = list(self.names)
        own = self.joints[:, [found.index(name) for name in names]]
        assert len(own) == first + len(joints)
        assert np.linalg.norm(own[first:] - joints, axis=-1).max() < 1e-3
        if first:
            assert own[0, :, 1].min() == pytest.approx(0, abs=1e-4), "the toes are on the floor in the T-pose"


def three_name(name: str) -> str:
    """The name of a node in three.js."""
    return re.sub(r"[\[\].:/]", "", re.sub(r"\s", "_", name))


def opened_in_blender(saved: Path) -> Opened:
    """Joints that `blender_motions.py` saved."""
    with np.load(saved) as seen:
        return Opened(
            [str(name) for name in seen["names"]],
            seen["joints"],
            seen["times"],
            seen["rest"],
            points=seen["points"],
            empties=int(seen["empties"]),
            fps=float(seen["fps"]),
        )


def opened_in_three(path: Path, *, unit: float = 0.01) -> Opened:
    """A glb or FBX file in three.js, whose FBXLoader reads neither axes nor unit, metres: that of the file."""
    fbx = path.suffix == ".fbx"
    seen = node("three_fbx.mjs" if fbx else "three_glb.mjs", "three", path)
    scale = unit if fbx else 1.0
    rest = scale * np.array(seen["rest"]) if "rest" in seen else None
    joints = scale * np.array(seen["joints"])
    meshes, extras = seen.get("meshes", ()), seen.get("extras")
    return Opened(seen["names"], joints, np.array(seen["times"]), rest, meshes, extras=extras)


def opened_in_ufbx(path: Path, fps: float, *, unit: float = 0.01, up: str = "y") -> Opened:
    """An FBX file in ufbx, which gives each node in its parent.

    Args:
        fps: samples a second.
        unit, up: of the file, the unit in metres.
    """
    seen = json.loads(python("MAREY_UFBX_PYTHON", "ufbx_joints.py", path, fps))
    local = np.array(seen["local"]).swapaxes(0, 1)
    world: dict[int, tuple[Array, Array, Array]] = {}
    for index, (name, parent) in enumerate(zip(seen["names"], seen["parents"], strict=True)):
        if name not in seen["moving"]:
            continue  # meshes, and the root that ufbx adds
        track = local[:, seen["moving"].index(name)]
        place, turn, scale = track[:, :3], track[:, [6, 3, 4, 5]], track[:, 7:]
        assert parent in world or parent <= 0, "nothing that carries a bone is left out"
        if parent in world:
            above, origin, size = world[parent]
            turn, place, scale = multiply(above, turn), origin + rotate(above, size * place), size * scale
        world[index] = (turn, place, scale)
    joints = unit * np.stack([place for _, place, _ in world.values()], axis=1)
    if up == "z":
        joints = joints[..., [0, 2, 1]] * [1, 1, -1]
    return Opened([seen["names"][index] for index in world], joints, np.array(seen["times"]))


def opened_in_usd(saved: Path) -> Opened:
    """Joints that `usd_check.py` saved, of a file in which it found no fault."""
    seen = json.loads(saved.read_text(encoding="utf-8"))
    assert seen["faults"] == []
    assert seen["validators"] > 20
    assert seen["end"] == len(seen["times"]) - 1
    return Opened(seen["names"], np.array(seen["joints"]), np.array(seen["times"]), np.array(seen["rest"]))
