"""`examples/blender/play_on_character.py`: motions on a character with a mesh, their feet, seams and picture."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from marey.exporters import Coordinates, exporter_of
from marey.motion import MotionClip, edit
from marey.motion.feet import find_contacts
from marey.motion.pose import solve_pose
from marey.motion.skeleton import HUMANML3D
from tests.support import bodies
from tests.support.clients import blender_command
from tests.support.marey import REPOSITORY
from tests.support.walker import walker

pytestmark = pytest.mark.slow

SCRIPT = REPOSITORY / "examples" / "blender" / "play_on_character.py"
LENGTHS = {"L_hip": 1.1, "R_hip": 1.1, "L_knee": 1.2, "R_knee": 1.2, "L_ankle": 1.2, "R_ankle": 1.2, "spine1": 0.9}


@pytest.fixture
def character(tmp_path: Path) -> Path:
    """A body with a mesh and longer legs."""
    clip = walker(seconds=1)
    offsets = clip.skeleton.offsets.copy()
    for joint, length in LENGTHS.items():
        offsets[clip.skeleton.index(joint)] *= length
    tall = MotionClip.of(clip.skeleton.with_offsets(offsets), clip.rotations, clip.root, clip.contacts, clip.fps)
    path = tmp_path / "hero.fbx"
    path.write_bytes(exporter_of("fbx").write(tall, Coordinates(mesh=True)))
    return path


def walked(seconds: float, turn: float = 0.0) -> MotionClip:
    """A walk whose feet stand still; `turn` in degrees."""
    pose = solve_pose(bodies.Body(seconds, speed=lambda t: 1.1 + 0 * t, turn=turn).joints(), HUMANML3D, fps=bodies.FPS)
    contacts = find_contacts(pose.joints, pose.skeleton, bodies.FPS)
    return MotionClip.of(pose.skeleton, pose.rotations, pose.root, contacts, bodies.FPS)


def written(clip: MotionClip, path: Path, character: Path, **options: str) -> Path:
    """Write an FBX on the character with the npz beside it."""
    path.write_bytes(exporter_of("fbx").write(clip, Coordinates(rig=str(character), **options)))
    clip.save_npz(path.with_suffix(".npz"))
    return path


def play(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [*blender_command(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)


def test_a_loop_in_place_and_a_turning_walk_keep_their_bars_and_are_drawn(character: Path, tmp_path: Path) -> None:
    (loop,) = edit(walked(6), [{"op": "loop"}])
    motions = [
        written(loop, tmp_path / "loop.fbx", character, in_place="travel"),
        written(walked(3, turn=90), tmp_path / "turn.fbx", character),
    ]
    done = play(character, *motions, "--picture", tmp_path / "a.png", "--samples", 1)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"loop: 3 cycles of {loop.frames - 1} frames, in place" in done.stdout
    assert "turn: 60 frames\n" in done.stdout
    with Image.open(tmp_path / "a.png") as image:
        picture = np.asarray(image.convert("RGB")).astype(int)
    assert (picture[..., 2] - picture[..., 0] > 60).sum() > 3000  # the first motion, blue
    assert (picture[..., 0] - picture[..., 2] > 60).sum() > 3000  # the second one, orange


def test_a_jump_at_the_seam_and_sliding_feet_are_found(character: Path, tmp_path: Path) -> None:
    (loop,) = edit(walked(6), [{"op": "loop"}])
    part = slice(0, loop.frames - 4)
    torn = MotionClip.of(
        loop.skeleton, loop.rotations[part], loop.root[part], loop.contacts[part], loop.fps, manifest=loop.manifest
    )
    done = play(character, written(torn, tmp_path / "torn.fbx", character, in_place="travel"))
    assert done.returncode == 1, done.stderr
    assert any(line.split()[0] == "seam" and line.endswith("MISSED") for line in done.stdout.splitlines() if line)
    clip = walked(2)
    slow = replace(clip, root=clip.root * np.float32([0.5, 1, 0.5]))
    path = written(slow, tmp_path / "slow.fbx", character)
    clip.save_npz(path.with_suffix(".npz"))
    done = play(character, path)
    assert done.returncode == 1, done.stderr
    assert any(line.split()[0] == "slip" and line.endswith("MISSED") for line in done.stdout.splitlines() if line)


def test_a_motion_for_another_skeleton_is_refused(character: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.fbx"
    path.write_bytes(exporter_of("fbx").write(walker(), Coordinates(rig="mixamo")))
    walker().save_npz(path.with_suffix(".npz"))
    done = play(character, path)
    assert done.returncode == 1
    assert "write it with --rig and the file of the character" in done.stderr
