"""Conversion of features to a clip: seconds of each step for 196 frames on one core, and accuracy of the poses.

The baseline is the way public text-to-motion exporters take: sweeps over the skeleton that turn each joint towards its
children, 100 times (after Holden's position-based inverse kinematics, as in MoMask's `joints2bvh.py`).

    OMP_NUM_THREADS=1 python -m benchmarks pose
"""

from __future__ import annotations

import numpy as np

from benchmarks.harness import measure, table
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import clean_feet, skate
from marey.motion.finish import finish_motion
from marey.motion.io.bvh import format_bvh, parse_bvh
from marey.motion.kinematics import forward_kinematics, global_rotations
from marey.motion.pose import measure_offsets, solve_pose
from marey.motion.rotations import (
    IDENTITY,
    Array,
    angle_between,
    between,
    conjugate,
    multiply,
    normalize,
    unroll,
)
from marey.motion.skeleton import HUMANML3D, Skeleton
from tests.support.motions import dancer, drift
from tests.support.walker import walker

FRAMES = 196


def dance() -> Array:
    """Joints (T, 22, 3) of a body that sways and bends, with smooth noise as in generated motion."""
    joints = forward_kinematics(HUMANML3D, *dancer(0, FRAMES))
    return joints + drift(1, FRAMES, 66, 0.004).reshape(FRAMES, 22, 3)


def slide() -> Array:
    """Joints of a walk with sliding feet, as in generated motion."""
    joints = np.array(walker(seconds=9.8).joints, np.float64)
    return joints + drift(2, len(joints), 3, 0.02)[:, None] * [1, 0, 1]


def sweeping_solver(joints: Array, skeleton: Skeleton, sweeps: int = 100) -> tuple[Array, Array]:
    """The baseline: rotations (T, J, 4) and the joints (T, J, 3) that they give."""
    skeleton = skeleton.with_offsets(measure_offsets(joints, skeleton))
    rotations = np.tile(IDENTITY, (*joints.shape[:2], 1))
    for _ in range(sweeps):
        for j in range(len(skeleton)):
            children = list(skeleton.children[j])
            if not children:
                continue
            world = global_rotations(skeleton, rotations)
            places = forward_kinematics(skeleton, rotations, joints[:, 0], world=world)
            turns = between(places[:, children] - places[:, j : j + 1], joints[:, children] - places[:, j : j + 1])
            turn = normalize(unroll(turns, axis=1).mean(axis=1))
            local = multiply(multiply(conjugate(world[:, j]), turn), world[:, j])
            rotations[:, j] = normalize(multiply(rotations[:, j], local))
    return rotations, forward_kinematics(skeleton, rotations, joints[:, 0])


def _quality(name: str, rotations: Array, solved: Array, joints: Array) -> str:
    off = 1e3 * np.linalg.norm(solved - joints, axis=-1)
    step = np.degrees(angle_between(rotations[1:], rotations[:-1])).max()
    return f"| {name} | {off.mean():.2f} mm | {off.max():.1f} mm | {step:.0f} degrees |"


def main() -> None:
    """Print the tables."""
    joints = dance()
    features = HUMANML3D_263.encode(joints)
    pose = solve_pose(joints, HUMANML3D)
    clip = finish_motion(features, HUMANML3D_263)
    text = format_bvh(clip)
    quick = measure(
        {
            "encode": lambda: HUMANML3D_263.encode(joints),
            "decode": lambda: HUMANML3D_263.decode(features),
            "solve_pose": lambda: solve_pose(joints, HUMANML3D),
            "clean_feet": lambda: clean_feet(pose.joints, pose.skeleton, 20),
            "finish_motion, 20 fps": lambda: finish_motion(features, HUMANML3D_263),
            "finish_motion, 60 fps": lambda: finish_motion(features, HUMANML3D_263, fps=60),
            "npz bytes": clip.to_npz,
            "BVH text": lambda: format_bvh(clip),
            "BVH parsed": lambda: parse_bvh(text.encode()),
        },
        repeats=50,
    )
    print(table(f"Motion of {FRAMES} frames", quick))
    against = measure(
        {
            "solve_pose": lambda: solve_pose(joints, HUMANML3D),
            "100 sweeps": lambda: sweeping_solver(joints, HUMANML3D),
        },
        repeats=3,
        warm_up=1,
    )
    print(table("Positions to rotations", against, baseline="100 sweeps"))
    print("| solver | mean error | largest | largest step |\n|---|---|---|---|")
    print(_quality("solve_pose", pose.rotations, pose.joints, joints))
    print(_quality("100 sweeps", *sweeping_solver(joints, HUMANML3D), joints))
    walk = slide()
    clean, contacts = clean_feet(walk, HUMANML3D, 20)
    slow, fast = (skate(j, contacts, HUMANML3D, 20) for j in (clean, walk))
    pop, was = (400 * np.linalg.norm(np.diff(j, 2, axis=0), axis=-1).max() for j in (clean, walk))
    print(f"\nfoot skate {100 * fast:.1f} cm/s before cleaning, {100 * slow:.3f} after; ", end="")
    print(f"largest acceleration {was:.0f} m/s² before, {pop:.0f} after\n")
