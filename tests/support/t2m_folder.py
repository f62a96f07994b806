"""A tiny folder in the layout of HumanML3D's publication, of our own motions: also that of KIT-ML and CMP."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.motion.features import HUMANML3D_263, HeadingLayout
from marey.motion.kinematics import forward_kinematics, mirror_joints
from marey.motion.rotations import about, from_rotvec, multiply
from tests.support.motions import drift

SAID = {
    "000001": (
        "a person walks forward slowly.#a/DET person/NOUN walk/VERB forward/ADV slowly/ADV#0.0#0.0",
        "he sways to the left#he/PRON sway/VERB to/ADP the/DET left/NOUN#1.0#4.0",
        "he sways to the left again#he/PRON sway/VERB to/ADP the/DET left/NOUN again/ADV#1.0#4.0",
        "a blink#a/DET blink/NOUN#1.0#1.2",
    ),
    "000002": ("someone  waves.#someone/PRON wave/VERB#0.0#0.0", "a figure bends#a/DET figure/NOUN bend/VERB#nan#nan"),
    "000003": ("a man turns and walks.#a/DET man/NOUN turn/VERB and/CCONJ walk/VERB#0.0#0.0",),
    "000004": ("a person crouches#a/DET person/NOUN crouch/VERB#0#0",),
    "000005": ("too short#too/ADV short/ADJ#0.0#0.0",),
}
FRAMES = {"000001": 120, "000002": 96, "000003": 60, "000004": 64, "000005": 20}
SPLITS = {
    "train": ("000001", "M000001", "000002", "M000002", "000005"),
    "val": ("000003", "M000003"),
    "test": ("000004",),
}


def swaying(layout: HeadingLayout, seed: int, frames: int, turns: float = 0.0) -> NDArray[np.floating]:
    """Joints (T, J, 3) in metres of a figure that sways, walks off along +Z and may turn to the left."""
    skeleton = layout.skeleton
    vectors = drift(seed, frames, 3 * len(skeleton), 0.15, fps=layout.fps).reshape(frames, -1, 3)
    rotations = from_rotvec(vectors)
    turn = about("Y", np.linspace(0.0, 2 * np.pi * turns, frames))
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    root = np.array([0.0, 0.95, 0.0]) + drift(seed + 1, frames, 3, 0.03, fps=layout.fps)
    root[:, 2] += np.linspace(0.0, frames / layout.fps, frames)
    return forward_kinematics(skeleton, rotations, root)


def write_folder(path: Path, layout: HeadingLayout = HUMANML3D_263) -> Path:
    """Write the folder; return its path."""
    for name in ("new_joint_vecs", "texts"):
        (path / name).mkdir(parents=True)
    every = []
    for seed, (name, frames) in enumerate(FRAMES.items()):
        joints = swaying(layout, 10 * seed, frames + 1, turns=0.1 * seed)
        for each, motion in ((name, joints), (f"M{name}", mirror_joints(joints, layout.skeleton))):
            every.append(layout.encode(motion))
            np.save(path / "new_joint_vecs" / f"{each}.npy", every[-1])
            said = [line.replace("left", "right") if each.startswith("M") else line for line in SAID[name]]
            (path / "texts" / f"{each}.txt").write_text("\n".join(said) + "\n", encoding="utf-8")
    values = np.concatenate(every).astype(np.float64)
    deviation = values.std(axis=0)
    for group in layout.slices.values():
        deviation[group] = deviation[group].mean()
    np.save(path / "Mean.npy", values.mean(axis=0).astype(np.float32))
    np.save(path / "Std.npy", deviation.astype(np.float32))
    for split, names in SPLITS.items():
        (path / f"{split}.txt").write_text("\n".join(names) + "\n")
    return path


def write_folder_to_measure(path: Path, layout: HeadingLayout = HUMANML3D_263) -> Path:
    """Write the folder with 39 test clips, more than a pool of the protocol: the others once more, under new names;
    return its path."""
    write_folder(path, layout)
    names = [f"x{number}" for number in range(39)]
    for number, name in enumerate(names):
        origin = ("000002", "000003", "000004")[number % 3]
        for part, ending in (("new_joint_vecs", "npy"), ("texts", "txt")):
            shutil.copy(path / part / f"{origin}.{ending}", path / part / f"{name}.{ending}")
    (path / "test.txt").write_text("\n".join(names))
    return path
