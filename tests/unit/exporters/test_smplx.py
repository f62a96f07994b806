"""SMPL-X parameters: a second forward kinematics finds the bones where the motion has them. The model is made up."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from marey.core.errors import InvalidFile, InvalidInput, TooLarge
from marey.exporters import Coordinates, exporter_of
from marey.exporters.convert import convert
from marey.motion.export_options import ExportOptions
from marey.motion.io.rig_smplx import JOINTS, PARENTS, VERTICES, parse_smplx_rig
from marey.motion.retarget.apply import put_on_rig
from marey.motion.rigs.read import read_rig
from marey.motion.skeleton import HUMANML3D
from tests.support.walker import walker

PLACES = np.zeros((55, 3))
PLACES[:22] = HUMANML3D.rest * 0.9 + [0.01, -1.2, 0.02]
PLACES[[18, 20]] += [[-0.02, -0.06, 0.0], [-0.06, -0.14, 0.02]]  # arms that hang a little
PLACES[[19, 21]] += [[0.02, -0.06, 0.0], [0.06, -0.14, 0.02]]
PLACES[22:25] = PLACES[15] + [[0, -0.02, 0.05], [0.03, 0.05, 0.07], [-0.03, 0.05, 0.07]]
for _joint in range(25, 55):
    _side = 1 if _joint < 40 else -1
    PLACES[_joint] = PLACES[PARENTS[_joint]] + [0.03 * _side, 0, 0.01 * ((_joint - 25) % 15 // 3 - 2)]


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A file with the arrays of the model that matter: each joint is a vertex of its own."""
    points, weights = np.random.default_rng(0).normal(size=(VERTICES, 3)), np.zeros((55, VERTICES))
    points[:55], weights[:, :55] = PLACES, np.eye(55)
    np.savez(tmp_path / "SMPLX_NEUTRAL.npz", v_template=points, J_regressor=weights, shapedirs=np.zeros((3, 3)))
    return tmp_path / "SMPLX_NEUTRAL.npz"


def matrix(vector: np.ndarray) -> np.ndarray:
    """Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def posed(file: dict[str, np.ndarray]) -> np.ndarray:
    """Joints (T, 55, 3) as the model places them, turned to Y up."""
    frames = []
    for pose, trans in zip(file["poses"].reshape(-1, 55, 3).astype(float), file["trans"].astype(float), strict=True):
        turns, joints = [matrix(pose[0])], [PLACES[0] + trans]
        for joint in range(1, 55):
            parent = PARENTS[joint]
            turns.append(turns[parent] @ matrix(pose[joint]))
            joints.append(joints[parent] + turns[parent] @ (PLACES[joint] - PLACES[parent]))
        frames.append(joints)
    return np.array(frames)[..., [0, 2, 1]] * [1, 1, -1]


def test_the_tree_is_that_of_the_model() -> None:
    assert len(JOINTS) == len(PARENTS) == 55
    assert [JOINTS[PARENTS[JOINTS.index(name)]] for name in ("left_index1", "left_index2", "right_thumb3", "jaw")] == [
        "left_wrist", "left_index1", "right_thumb2", "head",
    ]  # fmt: skip
    assert JOINTS[25] == "left_index1"
    assert JOINTS[40] == "right_index1"


def test_bones_have_the_directions_of_the_retargeted_motion(model: Path, tmp_path: Path) -> None:
    clip = walker(turn=0.7, fps=30)
    clip.save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.smplx.npz", export=ExportOptions(rig=str(model)))
    with np.load(tmp_path / "b.smplx.npz", allow_pickle=False) as npz:
        file = {key: npz[key] for key in npz.files}
    motion = put_on_rig(clip, ExportOptions(rig=str(model)))
    wanted = motion.world()[1][:, [motion.rig.index(name) for name in JOINTS]]
    joints = posed(file)
    np.testing.assert_allclose(joints[:, :22], wanted[:, :22], atol=1e-4)
    ours, theirs = (each[:, 1:22] - each[:, PARENTS[1:22]] for each in (wanted, joints))
    cosine = (ours * theirs).sum(-1) / np.linalg.norm(ours, axis=-1) / np.linalg.norm(theirs, axis=-1)
    assert np.degrees(np.arccos(cosine.min().clip(-1, 1))) < 1
    # and those of the clip itself, but for what bones of other proportions change
    arm = [clip.skeleton.index(name) for name in ("L_shoulder", "L_elbow")]
    source = clip.joints[:, arm[1]] - clip.joints[:, arm[0]]
    upper = joints[:, 18] - joints[:, 16]
    cosine = (source * upper).sum(-1) / np.linalg.norm(source, axis=-1) / np.linalg.norm(upper, axis=-1)
    assert np.degrees(np.arccos(cosine.min().clip(-1, 1))) < 10
    assert joints[0, 12, 1] - joints[0, 0, 1] > 0.3, "upright"


def test_the_file_has_the_keys_that_tools_read(model: Path) -> None:
    clip = walker(fps=30)
    data = exporter_of("smplx").write(clip, Coordinates(rig=str(model)))
    path = model.with_name("c.npz")
    path.write_bytes(data)
    with np.load(path, allow_pickle=False) as file:
        parts = [file[key] for key in ("root_orient", "pose_body", "pose_jaw", "pose_eye", "pose_hand")]
        np.testing.assert_array_equal(np.concatenate(parts, axis=1), file["poses"])
        assert file["poses"].shape == (clip.frames, 165)
        assert not file["poses"][:, 66:].any(), "face and fingers are at rest"
        assert (str(file["gender"]), str(file["surface_model_type"])) == ("neutral", "smplx")
        assert file["mocap_frame_rate"] == file["mocap_framerate"] == 30
        assert file["mocap_time_length"] == pytest.approx(clip.frames / 30)
        assert file["betas"].shape == (16,)
    assert data == exporter_of("smplx").write(clip, Coordinates(rig=str(model)))


def test_without_the_model_it_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"^(humanml3d|mixamo): .*smplx files need(.|\n)*SMPLX_NEUTRAL"):
        exporter_of("smplx").write(walker(), Coordinates())
    with pytest.raises(InvalidInput, match=r"^(humanml3d|mixamo): .*smplx files need(.|\n)*SMPLX_NEUTRAL"):
        exporter_of("smplx").write(walker(), Coordinates(rig="mixamo"))
    walker().save_npz(tmp_path / "a.npz")
    with pytest.raises(InvalidFile, match=r"a\.npz"):
        read_rig(tmp_path / "a.npz")
    with pytest.raises(InvalidFile):
        parse_smplx_rig(b"no npz", "a.npz")


def test_a_model_that_unpacks_to_more_than_it_may_is_refused(tmp_path: Path) -> None:
    """A small file of zeros, which would take all memory."""
    header = io.BytesIO()
    rows = 2**28 // 24 + 1
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (rows, 3)})
    path = tmp_path / "SMPLX_NEUTRAL.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        with archive.open("v_template.npy", "w") as file:
            file.write(header.getvalue())
            for _ in range(rows * 24 // 2**20 + 1):
                file.write(bytes(2**20))
        archive.writestr("J_regressor.npy", b"")
    with pytest.raises(TooLarge, match=r"over the limit of 0\.25 GiB"):
        parse_smplx_rig(path.read_bytes())
