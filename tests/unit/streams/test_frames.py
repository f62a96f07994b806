from __future__ import annotations

import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.core.frame_layout import HEADER, frame_bytes
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import angle_between, from_rotvec
from marey.motion.skeleton import HUMANML3D
from marey.streams.frames import Frame, decode_frame, encode_frame

FORMATS = Path(__file__).resolve().parents[3] / "docs" / "reference" / "formats.md"


def frame_of(seed=0, joints=22, **more) -> Frame:
    random = np.random.default_rng(seed)
    turns = from_rotvec(random.normal(size=(joints, 3)))
    values = {"number": 7, "root": random.normal(size=3).astype(np.float32), "rotations": turns.astype(np.float32)}
    return Frame(**(values | more))


frames = st.builds(
    frame_of,
    st.integers(0, 10_000),
    st.integers(1, 60),
    number=st.integers(0, 2**32 - 1),
    prompt=st.integers(0, 2**16 - 1),
    contacts=st.tuples(*[st.booleans()] * 4),
    last=st.booleans(),
    root=st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=3, max_size=3).map(np.float32),
)


@settings(max_examples=100, deadline=None)
@given(frames)
def test_a_frame_comes_back(frame):
    data = encode_frame(frame)
    assert len(data) == frame_bytes(len(frame.rotations))
    back = decode_frame(data, joints=len(frame.rotations))
    assert (back.number, back.prompt, back.last) == (frame.number, frame.prompt, frame.last)
    assert back.contacts == frame.contacts
    np.testing.assert_array_equal(back.root, frame.root)
    assert np.degrees(angle_between(back.rotations.astype(float), frame.rotations.astype(float))).max() < 0.004
    np.testing.assert_allclose(np.linalg.norm(back.rotations, axis=1), 1, atol=1e-6)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000))
def test_no_joint_of_a_body_is_moved_by_a_third_of_a_millimetre(seed):
    frame = frame_of(seed)
    back = decode_frame(encode_frame(frame))
    was, now = (forward_kinematics(HUMANML3D, f.rotations[None], f.root[None].astype(float)) for f in (frame, back))
    assert np.linalg.norm(was - now, axis=-1).max() < 3e-4


@settings(max_examples=50, deadline=None)
@given(frames, st.data())
def test_a_truncated_frame_is_refused(frame, data):
    whole = encode_frame(frame)
    cut = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(InvalidInput, match=f"^frame( \\d+)?: {cut} bytes"):
        decode_frame(whole[:cut])
    with pytest.raises(InvalidInput, match="bytes, not the"):
        decode_frame(whole + b"\0")


@settings(max_examples=200, deadline=None)
@given(st.one_of(st.binary(max_size=300), st.binary(min_size=196, max_size=196).map(lambda b: b"MF\x01\x00" + b)))
def test_foreign_bytes_are_refused_and_never_break_the_decoder(data):
    with pytest.raises(InvalidInput):
        decode_frame(data)


@pytest.mark.parametrize(
    ("at", "value", "says"),
    [
        (0, b"GL", "not a frame of a Marey stream"),
        (2, b"\x02", "version 2; this program reads 1"),
        (3, b"\x20", "flags 0x20"),
        (8, b"\x00\x00", "0 joints"),
        (8, b"\xff\xff", "65535 joints"),
        (8, b"\x15\x00", "21 joints, not 22"),
        (12, struct.pack("<f", float("nan")), "the root holds NaN"),
        (24, bytes(8), "the rotation of joint 0 has not length 1"),
        (192, b"\xff\x7f" * 4, "the rotation of joint 21 has not length 1"),
    ],
)
def test_what_is_wrong_with_a_frame_is_said(at, value, says):
    data = bytearray(encode_frame(frame_of()))
    data[at : at + len(value)] = value
    with pytest.raises(InvalidInput, match=says):
        decode_frame(bytes(data), joints=22)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"number": -1}, "out of range"),
        ({"number": 2**32}, "out of range"),
        ({"prompt": 2**16}, "out of range"),
        ({"root": np.zeros(2, np.float32)}, r"not \(3,\)"),
        ({"root": np.array([0, np.inf, 0], np.float32)}, "NaN or infinite"),
        ({"rotations": np.zeros((22, 3), np.float32)}, r"not \(3,\) and \(J, 4\)"),
        ({"rotations": np.zeros((22, 4), np.float32)}, "joint 0 has not length 1"),
        ({"rotations": np.full((22, 4), np.nan, np.float32)}, "joint 0 has not length 1"),
        ({"rotations": np.zeros((0, 4), np.float32)}, "J of 1 to"),
    ],
)
def test_a_frame_that_cannot_be_written_is_refused(change, says):
    with pytest.raises(InvalidInput, match=f"^frame.*: .*({says})"):
        encode_frame(replace(frame_of(), **change))


def test_the_header_keeps_numbers_where_a_browser_reads_them_as_arrays():
    assert HEADER.size == 24
    assert frame_bytes(22) == 200


def test_the_example_in_the_documentation_is_a_frame():
    text = FORMATS.read_text(encoding="utf-8")
    section = text[text.index("## Live frames") :]
    dump = re.search(r"```text\n(.*?)```", section, re.DOTALL)
    assert dump is not None
    data = bytes.fromhex("".join(line.split("|")[0] for line in dump.group(1).splitlines()))
    frame = decode_frame(data)
    assert (frame.number, frame.prompt, frame.last) == (300, 1, False)
    assert frame.contacts == (True, True, False, False)
    np.testing.assert_allclose(frame.root, [0.5, 0.9, -2.0], atol=1e-7)
    np.testing.assert_allclose(frame.rotations, [[1, 0, 0, 0], [np.sqrt(0.5), 0, np.sqrt(0.5), 0]], atol=3e-5)
    example = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    assert example is not None
    names: dict[str, object] = {"data": data}
    exec(example.group(1), names)
    np.testing.assert_allclose(names["rotations"], frame.rotations, atol=1e-6)
    np.testing.assert_allclose(names["root"], frame.root)
    assert (names["number"], names["contacts"], names["last"]) == (300, [True, True, False, False], False)


def test_a_frame_of_which_nothing_else_is_said_stands_on_no_foot_and_is_not_the_last():
    told = frame_of()
    plain = Frame(told.number, told.root, told.rotations)
    back = decode_frame(encode_frame(plain))
    for frame in (plain, back):
        assert (frame.contacts, frame.prompt, frame.last) == ((False,) * 4, 0, False)
