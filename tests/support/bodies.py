"""Synthetic bodies for tests of data and checks: people on the 22 joints, and rigs written as BVH."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.motion.rotations import from_matrix, normalize, to_euler
from marey.motion.skeleton import HUMANML3D
from marey.posing.bones import two_bones

Array = NDArray[np.floating]
FPS = 20.0
LENGTH = np.linalg.norm(HUMANML3D.offsets.astype(float), axis=1)
Curve = Callable[[Array], Array]


def zero(t: Array) -> Array:
    return np.zeros_like(t)


def lift(begin: float, end: float) -> Curve:
    """0 before and after, 1 between, with half a second of rise and fall."""
    return lambda t: np.clip((t - begin) / 0.5, 0, 1) * np.clip((end - t) / 0.5, 0, 1)


@dataclass(frozen=True)
class Body:
    """Movement of a synthetic person for `seconds`.

    Attributes:
        speed: metres a second along the heading, at each moment; negative is backward.
        turn: degrees to the left from start to end.
        left, right: how far the hand is lifted, 0 to 1.
        wave: swings a second of the lifted hands.
        lean: degrees of forward lean.
        duty: share of the gait cycle in which a foot stands; under 0.5 is a run.
        cadence: steps a second.
    """

    seconds: float
    speed: Curve = zero
    turn: float = 0.0
    left: Curve = zero
    right: Curve = zero
    wave: float = 0.0
    lean: Curve = zero
    duty: float = 0.62
    cadence: float = 1.8

    def joints(self) -> Array:
        """(T, 22, 3) metres at 20 fps."""
        t = np.arange(round(self.seconds * FPS)) / FPS
        heading = np.radians(self.turn) * np.clip((t / self.seconds - 0.3) / 0.4, 0, 1)
        forward = np.stack([np.sin(heading), 0 * t, np.cos(heading)], -1)
        side = np.stack([np.cos(heading), 0 * t, -np.sin(heading)], -1)  # to the left
        up = np.broadcast_to([0.0, 1.0, 0.0], forward.shape)
        speed = self.speed(t)
        pelvis = np.cumsum(speed[:, None] * forward, axis=0) / FPS + [0, 0.905, 0]
        out = np.empty((len(t), 22, 3))
        out[:, 0] = pelvis
        angle = np.radians(self.lean(t))[:, None]
        spine = np.cos(angle) * up + np.sin(angle) * forward
        chest = np.cos(angle) * forward - np.sin(angle) * up

        def put(joint: int, parent: int, hips: bool = False) -> None:
            x, y, z = HUMANML3D.offsets[joint].astype(float)
            frame = (up, forward) if hips else (spine, chest)
            out[:, joint] = out[:, parent] + x * side + y * frame[0] + z * frame[1]

        put(1, 0, True), put(2, 0, True)
        for joint, parent in ((3, 0), (6, 3), (9, 6), (12, 9), (13, 9), (14, 9), (15, 12), (16, 13), (17, 14)):
            put(joint, parent)
        for sign, shoulder, elbow, wrist, raised in ((1, 16, 18, 20, self.left(t)), (-1, 17, 19, 21, self.right(t))):
            r = raised[:, None]
            swing = 0.5 * np.sin(2 * np.pi * self.wave * t)[:, None] * (r > 0.9)
            upper = normalize((1 - r) * (0.12 * sign * side - spine) + r * (0.6 * sign * side + 0.6 * spine))
            lower = normalize((1 - r) * (-spine + 0.2 * chest) + r * (spine + (0.2 * sign + swing) * side))
            out[:, elbow] = out[:, shoulder] + LENGTH[elbow] * upper
            out[:, wrist] = out[:, elbow] + LENGTH[wrist] * lower
        for sign, phase, leg in ((1, 0.0, (1, 4, 7, 10)), (-1, 0.5, (2, 5, 8, 11))):
            toe = self._toe(t, pelvis, forward, side, sign, phase)
            foot = -0.06 * up + 0.13 * forward
            hip, knee, ankle, end = leg
            out[:, knee], out[:, ankle] = two_bones(out[:, hip], toe - foot, forward, (LENGTH[knee], LENGTH[ankle]))
            out[:, end] = out[:, ankle] + foot
        return out

    def _toe(self, t: Array, pelvis: Array, forward: Array, side: Array, sign: int, phase: float) -> Array:
        """(T, 3): stands for `duty` of each cycle under where the pelvis is in the middle of the stance."""
        under = pelvis * [1, 0, 1] + 0.08 * sign * side + 0.10 * forward
        if not np.abs(self.speed(t)).max():
            return under
        cycle = 2 / self.cadence
        k = np.floor(t / cycle + phase)
        within = t / cycle + phase - k
        swing = np.clip((within - self.duty) / (1 - self.duty), 0, 1)
        ease = swing**2 * (3 - 2 * swing)

        def stance(number: Array) -> Array:
            middle = np.clip((number - phase + self.duty / 2) * cycle * FPS, 0, len(t) - 1)
            low = np.floor(middle).astype(int)
            return under[low] + (middle - low)[:, None] * (under[np.minimum(low + 1, len(t) - 1)] - under[low])

        toe = stance(k) + ease[:, None] * (stance(k + 1) - stance(k))
        toe[:, 1] += 0.12 * np.sin(np.pi * swing)
        return toe


def steady(speed: float) -> Curve:
    return lambda t: np.full_like(t, speed)


def walker(seconds: float = 4.0, **more: object) -> Array:
    return Body(seconds, speed=steady(1.1), **more).joints()  # type: ignore[arg-type]


def runner(seconds: float = 4.0) -> Array:
    return Body(seconds, speed=steady(2.6), duty=0.3, cadence=2.6).joints()


def waver(side: str, seconds: float = 4.0, *, begin: float = 0.3) -> Array:
    up = lift(begin, seconds - 0.3)
    return Body(
        seconds,
        left=up if side in ("left", "both") else zero,
        right=up if side in ("right", "both") else zero,
        wave=2.0,
    ).joints()


def raiser(side: str, seconds: float = 3.0) -> Array:
    up = lift(0.4, seconds - 0.4)
    return Body(
        seconds, left=up if side in ("left", "both") else zero, right=up if side in ("right", "both") else zero
    ).joints()


def bower(seconds: float = 3.0) -> Array:
    return Body(seconds, lean=lambda t: 45 * lift(0.4, seconds - 0.4)(t)).joints()


# -- rigs as BVH ---------------------------------------------------------------------------------------------------

BANDAI = (
    ("joint_Root", -1),
    ("Hips", 0),
    ("Spine", 1),
    ("Chest", 2),
    ("Neck", 3),
    ("Head", 4),
    ("Shoulder_L", 3),
    ("UpperArm_L", 6),
    ("LowerArm_L", 7),
    ("Hand_L", 8),
    ("Shoulder_R", 3),
    ("UpperArm_R", 10),
    ("LowerArm_R", 11),
    ("Hand_R", 12),
    ("UpperLeg_L", 1),
    ("LowerLeg_L", 14),
    ("Foot_L", 15),
    ("Toes_L", 16),
    ("UpperLeg_R", 1),
    ("LowerLeg_R", 18),
    ("Foot_R", 19),
    ("Toes_R", 20),
)
# joint of HumanML3D that stands at each of the rig's joints; the root stays at the origin
_BANDAI_FROM = (-1, 0, 3, 6, 12, 15, 13, 16, 18, 20, 14, 17, 19, 21, 1, 4, 7, 10, 2, 5, 8, 11)


def bandai_bvh(joints: Array, *, scale: float = 1.0, fps: float = 30.0) -> bytes:
    """A motion (T, 22, 3) on the rig of the Bandai-Namco sets: six channels a joint, positions replace the OFFSETs."""
    world = np.stack([joints[:, k] if k >= 0 else joints[:, 0] * 0 for k in _BANDAI_FROM], axis=1) * scale
    turns = np.broadcast_to(np.eye(3), (*world.shape[:2], 3, 3)).copy()
    for foot, toe in ((16, 17), (20, 21)):  # the foot's own Y points to the body's left, X along the bone
        x = normalize(world[:, toe] - world[:, foot])
        across = joints[:, 1] - joints[:, 2]
        y = normalize(across - x * np.einsum("ti,ti->t", x, across)[:, None])
        turns[:, foot] = np.stack([x, y, np.cross(x, y)], axis=-1)
    rows = []
    for j, (_, parent) in enumerate(BANDAI):
        base = turns[:, parent] if parent >= 0 else np.broadcast_to(np.eye(3), (len(world), 3, 3))
        origin = world[:, parent] if parent >= 0 else world[:, j] * 0
        place = np.einsum("tji,tj->ti", base, world[:, j] - origin) * 100
        local = np.einsum("tji,tjk->tik", base, turns[:, j])
        rows += [place, to_euler(from_matrix(local), "ZXY")]
    values = np.concatenate(rows, axis=1)
    text = _hierarchy(0, values[0].reshape(-1, 6)) + f"MOTION\nFrames: {len(values)}\nFrame Time: {1 / fps:.7f}\n"
    return (text + "\n".join(" ".join(f"{v:.6f}" for v in row) for row in values) + "\n").encode()


def _hierarchy(joint: int, first: Array, depth: int = 0) -> str:
    pad = "  " * depth
    name, parent = BANDAI[joint]
    head = "HIERARCHY\nROOT" if parent < 0 else pad + "JOINT"
    offset = " ".join(f"{v:.6f}" for v in first[joint, :3])
    channels = "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    inner = "".join(_hierarchy(c, first, depth + 1) for c, (_, p) in enumerate(BANDAI) if p == joint)
    end = inner or f"{pad}  End Site\n{pad}  {{\n{pad}    OFFSET 0 0 0\n{pad}  }}\n"
    return f"{head} {name}\n{pad}{{\n{pad}  OFFSET {offset}\n{pad}  CHANNELS {channels}\n{end}{pad}}}\n"
