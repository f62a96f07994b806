"""Changed copies of a skeleton as rigs: the same body with other axes, rest pose, spine, unit and order of joints."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from marey.motion.clip import MotionClip
from marey.motion.kinematics import forward_kinematics, global_rotations
from marey.motion.retarget.source import Source
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.make_rig import RigNode, make_rig
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import Z_TO_Y, about, conjugate, from_rotvec, multiply, rotate, to_matrix
from marey.motion.skeleton import HUMANML3D
from marey.motion.units import Up

TRUNK = ("spine1", "spine2", "spine3")


@dataclass(frozen=True)
class Change:
    """A changed copy of HumanML3D's skeleton, drawn from a seed.

    Attributes:
        pose: rest pose: `t`, `a`, or `random`.
        spine: joints of the spine, 1 to 6.
        unit: metres of one unit of the file.
        up: axis of the file that points up.
    """

    seed: int
    pose: str
    spine: int
    unit: float
    up: Up
    roll: bool = True
    twists: bool = True
    roots: bool = True
    shuffled: bool = True

    @classmethod
    def draw(cls, seed: int) -> Change:
        draw = np.random.default_rng(seed)
        return cls(
            seed,
            str(draw.choice(["t", "a", "random"])),
            int(draw.integers(1, 7)),
            float(draw.choice([0.01, 1.0, 100.0])),
            "z" if draw.integers(2) else "y",
            *(bool(draw.integers(2)) for _ in range(4)),
        )

    def rig(self) -> Rig:
        """Return the rig; joints that stand for the original's have its names."""
        draw = np.random.default_rng([self.seed, 1])
        names, parents, places = self._tree()
        turned = _pose(self.pose, names, draw)
        world = [np.array([1.0, 0, 0, 0])] * len(names)
        posed = np.array(places)
        for joint, parent in enumerate(parents):
            world[joint] = turned[joint] if parent < 0 else multiply(world[parent], turned[joint])
            if parent >= 0:
                posed[joint] = posed[parent] + rotate(world[parent], places[joint] - places[parent])
        nodes: list[RigNode] = []
        for joint, name in enumerate(names):
            axes = from_rotvec(draw.normal(size=3) * 2) if self.roll else np.array([1.0, 0, 0, 0])
            turn, place = multiply(world[joint], axes), posed[joint]
            if self.up == "z":
                turn, place = multiply(conjugate(Z_TO_Y), turn), rotate(conjugate(Z_TO_Y), place)
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = to_matrix(turn), place / self.unit
            nodes.append(RigNode(name, parents[joint], matrix))
        if self.shuffled:
            order = draw.permutation(len(nodes)).tolist()
            place_of = {old: new for new, old in enumerate(order)}
            nodes = [RigNode(n.name, place_of.get(n.parent, -1), n.matrix) for n in (nodes[old] for old in order)]
        sha256 = hashlib.sha256(str(self).encode()).hexdigest()
        return make_rig(nodes, name="copy", where="copy", unit=self.unit, up=self.up, source="json", sha256=sha256)

    def _tree(self) -> tuple[list[str], list[int], np.ndarray]:
        """Return names, parents and T-pose of the copy: spine joints merged or split, twist joints, roots."""
        rest = HUMANML3D.rest.astype(np.float64)
        rest[:, 1] -= rest[:, 1].min()
        place = dict(zip(HUMANML3D.joint_names, rest, strict=True))
        parents = HUMANML3D.parents
        over = {
            name: HUMANML3D.joint_names[parents[joint]] if joint else None
            for joint, name in enumerate(HUMANML3D.joint_names)
        }
        chain = self.trunk()
        for name in TRUNK:
            del over[name]
        below = "pelvis"
        line = [place[name] for name in (*TRUNK, "neck")]
        for name, at in chain:
            over[name], place[name] = below, line[int(at)] + (at % 1) * (line[min(int(at) + 1, 3)] - line[int(at)])
            below = name
        for name, parent in list(over.items()):
            if parent in TRUNK and name not in dict(chain):
                over[name] = below
        if self.twists:
            for begin, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")):
                for side in "LR":
                    over[f"{side}_{begin}_twist"] = f"{side}_{begin}"
                    place[f"{side}_{begin}_twist"] = 0.4 * place[f"{side}_{begin}"] + 0.6 * place[f"{side}_{end}"]
        if self.roots:
            over |= {"world": None, "master": "world", "pelvis": "master"}
            place |= {"world": np.zeros(3), "master": np.zeros(3)}
        names: list[str] = []
        while len(names) < len(over):
            names += [
                name for name, parent in over.items() if name not in names and (parent is None or parent in names)
            ]
        return (
            names,
            [-1 if over[n] is None else names.index(over[n]) for n in names],
            np.array([place[n] for n in names]),
        )

    def trunk(self) -> list[tuple[str, float]]:
        """Return the spine joints of the copy with their place: 0, 1, 2 are the original's, fractions lie between."""
        if self.spine == 1:
            return [("spine1", 0.0)]
        if self.spine == 2:
            return [("spine1", 0.0), ("spine3", 2.0)]
        extra = [0.5, 1.5, 2.5][: self.spine - 3]
        return [(f"spine{int(n) + 1}" if n in (0, 1, 2) else f"spine_{n}", n) for n in sorted([0.0, 1.0, 2.0, *extra])]

    def motion(self, clip: MotionClip) -> MotionClip:
        """Return the clip with a spine that bends where the copy has joints, so that it can follow."""
        rotations = clip.rotations.astype(np.float64)
        for name in TRUNK:
            if name not in dict(self.trunk()):
                rotations[:, HUMANML3D.index(name)] = [1.0, 0, 0, 0]
        return MotionClip.of(clip.skeleton, rotations, clip.root, clip.contacts, clip.fps, manifest=clip.manifest)


def _pose(pose: str, names: list[str], draw: np.random.Generator) -> np.ndarray:
    """Return local turns of the rest pose: an A-pose, or a random one; twist joints stay on their bones."""
    turned = np.tile([1.0, 0, 0, 0], (len(names), 1))
    for joint, name in enumerate(names):
        if pose == "random" and not name.endswith("_twist") and name not in ("world", "master"):
            turned[joint] = from_rotvec(draw.normal(size=3) * 0.5)
        elif pose == "a" and name in ("L_shoulder", "R_shoulder"):
            turned[joint] = about("Z", -0.8 if name == "L_shoulder" else 0.8)
        elif pose == "a" and name in ("L_hip", "R_hip"):
            turned[joint] = about("Z", 0.12 if name == "L_hip" else -0.12)
    return turned


def lively(clip: MotionClip, seed: int) -> MotionClip:
    """Return a clip whose trunk, arms and head move too."""
    draw = np.random.default_rng(seed)
    rotations = clip.rotations.astype(np.float64)
    time = np.arange(clip.frames) / clip.fps
    for name in (*TRUNK, "neck", "pelvis", "L_collar", "R_collar", "L_shoulder", "R_elbow", "L_ankle"):
        joint = HUMANML3D.index(name)
        swing = 0.25 * np.sin(time[:, None] * draw.uniform(1, 4, 3) + draw.uniform(0, 6, 3)) * draw.normal(size=3)
        rotations[:, joint] = multiply(rotations[:, joint], from_rotvec(swing))
    root = clip.root.astype(np.float64)
    world = global_rotations(clip.skeleton, rotations)
    lowest = forward_kinematics(clip.skeleton, rotations, root, world=world)[..., 1].min()
    return MotionClip.of(
        clip.skeleton, rotations, root - [0, lowest, 0], clip.contacts, clip.fps, manifest=clip.manifest
    )


def source_on_rig(motion: RiggedMotion) -> Source:
    """Return a motion on a rig as one to retarget."""
    body = RigBody.of(motion.rig)
    world, places = motion.world()
    turned = multiply(world, conjugate(multiply(body.upright, motion.rig.orientations)))
    return Source(body, turned, places, motion.contacts, motion.fps)
