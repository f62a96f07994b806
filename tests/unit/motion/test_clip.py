from __future__ import annotations

import io
import json
import pickle
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidFile, InvalidInput, NotFound, TooLarge
from marey.motion import clip as clips
from marey.motion.clip import KEYS, MotionClip, load_npz, parse_npz
from marey.motion.kinematics import forward_kinematics
from marey.motion.skeleton import HUMANML3D, SNAPMOGEN
from tests.support.exported import tumbling
from tests.support.walker import walker


def same(a: MotionClip, b: MotionClip) -> bool:
    arrays = ("rotations", "root", "joints", "contacts", "features", "offsets")
    return (
        all(np.array_equal(getattr(a, n), getattr(b, n)) for n in arrays)
        and (a.fps, a.features_fps, a.skeleton.joint_names) == (b.fps, b.features_fps, b.skeleton.joint_names)
        and dict(a.manifest) == dict(b.manifest)
    )


@pytest.mark.parametrize("clip", [walker(prompt="é 🕺"), tumbling(SNAPMOGEN, 24000 / 1001)], ids=["walk", "tumble"])
def test_a_clip_comes_back_from_its_file(clip, tmp_path):
    clip.save_npz(tmp_path / "a.npz")
    back = load_npz(tmp_path / "a.npz")
    assert same(clip, back)
    assert back.skeleton.feet == clip.skeleton.feet


def test_the_file_is_the_contract(tmp_path):
    clip = walker()
    clip.save_npz(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz", allow_pickle=False) as file:
        assert sorted(file.files) == sorted(KEYS)
        kinds = {key: (file[key].dtype.kind, file[key].dtype.itemsize, file[key].ndim) for key in KEYS}
        assert kinds["joints"] == kinds["rotations"] == ("f", 4, 3)
        assert kinds["root"] == kinds["offsets"] == kinds["features"] == ("f", 4, 2)
        assert kinds["contacts"] == ("b", 1, 2)
        assert kinds["fps"] == kinds["features_fps"] == ("f", 8, 0)
        assert kinds["parents"][0] == "i"
        assert kinds["names"][0] == kinds["manifest"][0] == "U"
        assert json.loads(str(file["manifest"])) == {"prompt": "a person walks", "seed": 7}
        joints = forward_kinematics(HUMANML3D, file["rotations"], file["root"])
        np.testing.assert_allclose(joints, file["joints"], atol=1e-6)


def test_equal_clips_give_equal_bytes():
    assert walker().to_npz() == walker().to_npz()
    one, other = ({"prompt": "walk", "seed": 7}, {"seed": 7, "prompt": "walk"})
    assert replace(walker(), manifest=one).to_npz() == replace(walker(), manifest=other).to_npz()


def test_seconds_and_frames():
    clip = walker(seconds=3, fps=20)
    assert (clip.frames, clip.seconds) == (61, 3.05)


def changed(**arrays) -> bytes:
    """A clip's file with some arrays replaced (None: left out)."""
    with np.load(io.BytesIO(walker().to_npz())) as file:
        everything = {key: file[key] for key in KEYS} | arrays
    buffer = io.BytesIO()
    np.savez(buffer, **{key: value for key, value in everything.items() if value is not None})
    return buffer.getvalue()


BAD = {
    "no joints": ({"joints": None}, "has no joints"),
    "names and fps missing": ({"names": None, "fps": None}, "names, fps"),
    "joints of two axes": ({"joints": np.zeros((41, 22), np.float32)}, "`joints` has shape"),
    "joints of integers": ({"joints": np.zeros((41, 22, 3), int)}, "`joints` holds int"),
    "other frames": ({"root": np.zeros((3, 3), np.float32)}, "`root` has shape"),
    "no frames": (
        {
            "joints": np.zeros((0, 22, 3), np.float32),
            "rotations": np.zeros((0, 22, 4), np.float32),
            "root": np.zeros((0, 3), np.float32),
            "contacts": np.zeros((0, 4), bool),
        },
        "0 frames",
    ),
    "nan": ({"root": np.full((41, 3), np.nan, np.float32)}, "NaN"),
    "bones longer than the earth": ({"offsets": np.full((22, 3), 1e30, np.float32)}, "`offsets` holds numbers over"),
    "a root beyond the moon": ({"root": np.full((41, 3), -1e9, np.float32)}, "`root` holds numbers over 1,000,000"),
    "quaternions of another kind": ({"rotations": np.full((41, 22, 4), 1e30, np.float32)}, "unit length"),
    "offsets of another shape": ({"offsets": np.zeros((2, 3), np.float32)}, r"a\.npz: `offsets` has shape"),
    "quaternions too long": ({"rotations": np.ones((41, 22, 4), np.float32)}, "unit length"),
    "contacts of numbers": ({"contacts": np.zeros((41, 4))}, "`contacts` holds float64"),
    "rate of zero": ({"fps": np.float64(0)}, "0 fps"),
    "cycle": ({"parents": np.arange(22)}, "root"),
    "names twice": ({"names": np.array(["a"] * 22)}, "same name"),
    "manifest of words": ({"manifest": np.array("hello")}, "JSON|Expecting"),
    "manifest a list": ({"manifest": np.array("[1]")}, "not a JSON object"),
    **{
        f"{name} {given}": ({"manifest": np.array(f'{{"{name}": {given}}}')}, f"`{name}` of the manifest is not")
        for name, all_given in {
            "prompt": ("5", '["walk"]'),
            "licence": ("[]",),
            "prompts": (
                "5",
                '"walk"',
                "[5]",
                "[[0]]",
                '[["0", "walk"]]',
                "[[0, 5]]",
                '[[-1, "walk"]]',
                '[[9, "a"], [0, "b"]]',
            ),
            "timeline": (
                "5",
                "[]",
                '{"rows": 5}',
                '{"rows": [{"start": 0}]}',
                '{"rows": [{"start": 0, "end": 1}]}',
                '{"a": []}',
            ),
            "placement": ("null", '{"x": "1"}', '{"x": NaN}'),
            "loop": ("null", '{"end": "open"}', '{"end": "shut", "cycle": {"x": 0}}'),
        }.items()
        for given in all_given
    },
    "pickle": ({"names": np.array([{"a": 1}] * 22, object)}, "pickled objects, which are never loaded"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_foreign_or_broken_file_is_refused_with_its_reason(name, tmp_path):
    arrays, message = BAD[name]
    path = tmp_path / "a.npz"
    path.write_bytes(changed(**arrays))
    with pytest.raises(InvalidFile, match=message) as caught:
        load_npz(path)
    assert caught.value.where in (str(path), f"{path}: manifest")
    assert str(path) not in caught.value.message


def test_a_pickle_is_never_run(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (open, (str(tmp_path / "ran"), "w"))

    path = tmp_path / "a.npz"
    path.write_bytes(changed(names=np.array([Bomb()] * 22, object)))
    with pytest.raises(InvalidFile):
        load_npz(path)
    path.write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(InvalidFile, match="not a valid npz"):
        load_npz(path)
    assert not (tmp_path / "ran").exists()


def test_a_missing_file_is_not_found_and_a_folder_no_file(tmp_path):
    for error, path in ((NotFound, tmp_path / "none.npz"), (InvalidFile, tmp_path)):
        with pytest.raises(error) as refused:
            load_npz(path)
        assert refused.value.where == str(path)


def test_a_file_that_is_or_unpacks_to_too_much_is_not_read(monkeypatch, tmp_path):
    walker().save_npz(tmp_path / "a.npz")
    monkeypatch.setattr(clips, "MAX_UNPACKED", 1000)
    with pytest.raises(TooLarge, match=r"a\.npz"):
        load_npz(tmp_path / "a.npz")
    with pytest.raises(TooLarge):
        parse_npz(walker().to_npz())


@settings(max_examples=80, deadline=None)
@given(st.data())
def test_no_damage_to_a_file_gives_anything_but_a_clip_or_an_expected_error(data):
    content = bytearray(WALK)
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(content) - 1))
        if data.draw(st.booleans()):
            content[at : at + 4] = data.draw(st.binary(min_size=4, max_size=4))
        else:
            del content[at : at + data.draw(st.integers(1, 400))]
    try:
        clip = parse_npz(bytes(content))
    except (InvalidFile, TooLarge):
        return
    assert clip.frames == 41


WALK = walker().to_npz()


def test_a_header_that_claims_too_many_numbers_is_refused():
    header = np.lib.format.magic(1, 0)
    text = b"{'descr': '<f4', 'fortran_order': False, 'shape': (999999999999, 22, 3), }"
    text += b" " * (117 - len(text)) + b"\n"
    body = header + len(text).to_bytes(2, "little") + text
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(WALK)) as old, zipfile.ZipFile(buffer, "w") as new:
        for member in old.infolist():
            new.writestr(member.filename, body if member.filename == "joints.npy" else old.read(member))
    with pytest.raises(InvalidFile):
        parse_npz(buffer.getvalue())


def test_saving_into_no_folder_says_so(tmp_path):
    with pytest.raises(InvalidInput, match="cannot be written"):
        walker().save_npz(tmp_path / "none" / "a.npz")


def test_features_of_any_precision_are_kept_as_float32() -> None:
    clip = tumbling(HUMANML3D, 20.0)
    features = np.zeros((clip.frames, 3), np.float64)
    made = MotionClip.of(HUMANML3D, clip.rotations, clip.root, clip.contacts, fps=20.0, features=features)
    assert made.features.dtype == np.float32
