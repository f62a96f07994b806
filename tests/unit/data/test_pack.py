from __future__ import annotations

import numpy as np
import pytest

from marey.core.errors import InvalidFile, NotFound
from marey.data.dataset import known_set
from marey.data.pack import JointsPack, PackClip
from tests.support.bodies import runner, walker

FAR = np.array([40.0, 0.0, -30.0])  # float16 of world positions would be off by centimetres there


def pack() -> JointsPack:
    clip = PackClip("a", "bandai-namco", "2/walk", "normal", "train", 0, 0)
    far = runner(8.0) + FAR
    clips = [(clip, walker().astype(np.float32)), (clip, far.astype(np.float32))]
    return JointsPack.of(clips, [known_set("bandai-namco").terms])


def test_joints_come_back_to_half_a_millimetre_wherever_the_body_is(tmp_path):
    made = pack()
    made.save(tmp_path / "p.npz")
    read = JointsPack.load(tmp_path / "p.npz")
    assert read.clips == made.clips
    for clip, joints in zip(read.clips, (walker(), runner(8.0) + FAR), strict=True):
        assert np.abs(read.joints(clip) - joints).max() < 5e-4


def test_saving_twice_gives_the_same_bytes(tmp_path):
    pack().save(tmp_path / "a.npz")
    pack().save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"hello", lambda b: b""])
def test_a_damaged_pack_is_refused_with_its_path(tmp_path, damage):
    path = tmp_path / "p.npz"
    pack().save(path)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(InvalidFile, match=r"p\.npz"):
        JointsPack.load(path)


def test_a_pickle_in_the_pack_is_refused(tmp_path):
    path = tmp_path / "p.npz"
    np.savez(path, table=np.array([{"x": 1}], dtype=object), local=np.zeros((0, 21, 3)), root=np.zeros((0, 3)))
    with pytest.raises(InvalidFile):
        JointsPack.load(path)


def test_a_table_that_does_not_fit_the_arrays_is_refused(tmp_path):
    made = pack()
    JointsPack(made.clips, made.local[:-1], made.root[:-1]).save(tmp_path / "p.npz")
    with pytest.raises(InvalidFile, match="`local` has shape"):
        JointsPack.load(tmp_path / "p.npz")


def test_no_pack_is_not_found(tmp_path):
    with pytest.raises(NotFound):
        JointsPack.load(tmp_path / "p.npz")
