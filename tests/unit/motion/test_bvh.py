from __future__ import annotations

import contextlib
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidFile, InvalidInput, NotFound, TooLarge
from marey.motion.clip import MotionClip
from marey.motion.io import bvh, bvh_header
from marey.motion.io.bvh import first_frame_stands_apart, format_bvh, parse_bvh, read_bvh, write_bvh
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import about, angle_between, multiply, to_euler
from marey.motion.skeleton import HUMANML3D, KIT, SKELETONS, distinct_names
from marey.motion.units import METRES
from tests.support.exported import tumbling
from tests.support.walker import walker

SMALL = """HIERARCHY
ROOT Hips
{
\tOFFSET 0.0 0.0 0.0
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
\tJOINT Chest
\t{
\t\tOFFSET 0.0 20.0 0.0
\t\tCHANNELS 3 Zrotation Xrotation Yrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0.0 30.0 0.0
\t\t}
\t}
}
MOTION
Frames: 2
Frame Time: 0.0333333
1 90 2 90 0 0 0 90 0
1 91 2 90 0 0 0 90 0
"""


def parse(text: str, **options):
    return parse_bvh(text.encode(), "a.bvh", **options)


def test_a_small_file_is_read_in_metres():
    clip = parse(SMALL)
    assert clip.skeleton.joint_names == ("Hips", "Chest")
    assert clip.fps == 30
    np.testing.assert_allclose(clip.root, [[0.01, 0.9, 0.02], [0.01, 0.91, 0.02]])
    np.testing.assert_allclose(clip.joints()[0, 1], [0.01 - 0.2, 0.9, 0.02], atol=1e-12)  # Z turns up to -X
    np.testing.assert_allclose(clip.ends, [[np.nan] * 3, [0, 0.3, 0]])
    assert clip.notes == ()


def test_channels_apply_in_the_order_they_are_named():
    turned = multiply(about("Z", np.pi / 2), about("X", np.pi / 3))
    clip = parse(SMALL.replace("1 90 2 90 0 0 0 90 0", "1 90 2 90 60 0 0 90 0"))
    assert angle_between(clip.rotations[0, 0], turned) < 1e-6
    clip = parse(
        SMALL.replace("Zrotation Xrotation Yrotation", "Xrotation Zrotation Yrotation").replace(
            "1 90 2 90 0 0 0 90 0", "1 90 2 60 90 0 0 90 0"
        )
    )
    assert angle_between(clip.rotations[0, 0], multiply(about("X", np.pi / 3), about("Z", np.pi / 2))) < 1e-6


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.replace("\n", "\r\n"),
        lambda t: t.replace("\n", "\r"),
        lambda t: t.rstrip("\n"),
        lambda t: t + "\n\n  \n",
        lambda t: "\ufeff" + t,
        lambda t: t.replace(" ", "\t"),
        lambda t: t.replace("\t", "    "),
        lambda t: t.replace("\n{", " {").replace("\n\t{", " {"),
        lambda t: t.replace("End Site", "End site").replace("ROOT", "Root").replace("JOINT", "joint"),
        lambda t: t.replace("End Site", "End Site Chest_end"),
        lambda t: t.replace("Xposition", "XPOSITION").replace("Zrotation", "zrotation"),
        lambda t: (
            t.replace("MOTION", "\nMotion\n").replace("Frames: 2", "Frames:\t2").replace("Frame Time:", "frame time :")
        ),
        lambda t: t.replace("1 90 2 90 0 0 0 90 0\n", "1 90 2 90 0 \n 0 0 90 0\n"),
        lambda t: t.replace("90 0", "9.0e1 0"),
        lambda t: t.replace("90 0\n1 91", "90 0 1 91"),
    ],
)
def test_the_same_motion_is_read_however_it_is_written(change):
    clip = parse(change(SMALL))
    wanted = parse(SMALL)
    np.testing.assert_allclose(clip.joints(), wanted.joints(), atol=1e-12)
    assert (clip.skeleton.joint_names, clip.fps, clip.notes) == (("Hips", "Chest"), 30, ())


def test_a_joint_without_channels_keeps_its_offset():
    still = SMALL.replace("CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS 0").replace(" 0 90 0\n", "\n")
    clip = parse(still)
    joints = forward_kinematics(clip.skeleton, clip.rotations, clip.root)
    np.testing.assert_allclose(joints[:, 1] - joints[:, 0], [[-0.2, 0, 0]] * 2, atol=1e-6)


def test_a_name_made_for_a_second_joint_is_not_that_of_a_third():
    assert distinct_names(["a", "a", "a.2", "a", "b"]) == ("a", "a.3", "a.2", "a.4", "b")
    clip = parse(SMALL.replace("\tEnd Site\n\t\t{", "\tJOINT Hips\n\t\t{\n\t\t\tCHANNELS 0").replace("Chest", "Hips.2"))
    assert clip.skeleton.joint_names == ("Hips", "Hips.2", "Hips.3")


def test_names_may_hold_spaces_and_other_encodings():
    clip = parse_bvh(SMALL.replace("Chest", "Left Arm é").encode("latin-1"))
    assert clip.skeleton.joint_names[1] == "Left Arm é"


def test_joints_of_one_name_are_told_apart_and_noted():
    clip = parse(SMALL.replace("Chest", "Hips"))
    assert clip.skeleton.joint_names == ("Hips", "Hips.2")
    assert "several joints Hips" in clip.notes[0]


@pytest.mark.parametrize("said", [1, 3, 200])
def test_a_wrong_frame_count_is_noted_and_all_frames_are_read(said):
    clip = parse(SMALL.replace("Frames: 2", f"Frames: {said}"))
    assert len(clip.root) == 2
    assert clip.notes == (f"line 17: the header says {said} frames, the file holds 2",)


@pytest.mark.parametrize(
    ("time", "fps"),
    [
        ("0.0333333", 30),
        ("0.033333", 30),
        ("0.016667", 60),
        ("0.00833333", 120),
        ("0.04170833", 24000 / 1001),
        ("0.05", 20),
        ("0.08", 12.5),
        ("0.033", 1 / 0.033),
        ("0.033323", 1 / 0.033323),
    ],
)
def test_a_rounded_frame_time_is_taken_back_to_its_rate(time, fps):
    assert parse(SMALL.replace("0.0333333", time)).fps == pytest.approx(fps, rel=1e-9)


def moving(text: str, *rows: str) -> str:
    """The file with other frames."""
    return text[: text.index("1 90 2")] + "\n".join(rows) + "\n"


SIX = SMALL.replace("CHANNELS 3 Z", "CHANNELS 6 Xposition Yposition Zposition Z")


def test_positions_of_a_joint_replace_its_offset():
    clip = parse(moving(SIX, "1 90 2 90 0 0 0 20 0 0 90 0", "1 91 2 90 0 0 0 20 0 0 90 0"))
    assert clip.positions is None, "they are the offset all the time"
    np.testing.assert_allclose(clip.joints(), parse(SMALL).joints(), atol=1e-12)


def test_positions_that_change_stand_in_for_the_offset():
    clip = parse(moving(SIX, "1 90 2 0 0 0 0 20 0 0 0 0", "1 91 2 0 0 0 0 25 0 0 0 0"))
    assert clip.positions is not None
    np.testing.assert_allclose(clip.joints()[:, 1, 1], [1.1, 1.16], atol=1e-9)


def test_positions_near_zero_are_added_to_the_offset():
    clip = parse(moving(SIX, "1 90 2 0 0 0 0 0.1 0 0 0 0", "1 91 2 0 0 0 0 0.2 0 0 0 0"))
    np.testing.assert_allclose(clip.joints()[:, 1, 1], [1.101, 1.112], atol=1e-9)
    assert clip.notes == ("positions are added to the OFFSETs",)


def standing_root(offset: float, position: float) -> str:
    text = SMALL.replace("OFFSET 0.0 0.0 0.0", f"OFFSET 0.0 {offset} 0.0").replace(
        "OFFSET 0.0 20.0 0.0", "OFFSET 0 -90 0"
    )
    return text.replace("1 90 2 90 0 0 0 90 0", f"1 {position} 2 0 0 0 0 0 0").replace(
        "1 91 2 90 0 0 0 90 0", f"1 {position + 1} 2 0 0 0 0 0 0"
    )


def test_a_root_is_placed_so_that_the_feet_come_to_the_floor():
    added, replaced = parse(standing_root(90, 0)), parse(standing_root(90, 90))
    np.testing.assert_allclose(added.joints(), replaced.joints(), atol=1e-12)
    assert added.notes == ("positions are added to the OFFSETs",)
    assert replaced.notes == ()
    np.testing.assert_allclose(added.joints()[0, 1, 1], 0, atol=1e-6)


def test_how_positions_are_meant_can_be_said():
    assert parse(standing_root(90, 0), translation="replace").root[0, 1] == 0
    assert parse(standing_root(90, 90), translation="add").root[0, 1] == pytest.approx(1.8)


def with_rest_frame(clip: MotionClip) -> str:
    lines = format_bvh(clip).splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    zeros = " ".join(["0"] * len(lines[first].split()))
    lines[first - 2] = f"Frames: {clip.frames + 1}"
    return "\n".join([*lines[:first], zeros, *lines[first:]])


def test_a_t_pose_before_the_motion_is_left_out():
    clip = walker()
    text = with_rest_frame(clip)
    read = parse(text)
    assert len(read.root) == clip.frames
    assert read.rest is not None
    order = [read.skeleton.joint_names.index(n) for n in HUMANML3D.joint_names]
    np.testing.assert_allclose(read.rest[order], HUMANML3D.rest - HUMANML3D.rest[0], atol=1e-5)
    assert len(parse(text, rest_frame="keep").root) == clip.frames + 1


@pytest.mark.parametrize(("turns", "apart"), [((60, 5, 5, 5), True), ((60, 60, 5, 5), False), ((60, 5, 5, 60), False)])
def test_a_first_frame_stands_apart_where_no_later_step_turns_as_far(turns, apart):
    clip = parse(SMALL)
    angles = np.radians(np.cumsum([0, *turns]))
    rotations = np.repeat(about("x", angles)[:, None], 2, axis=1)
    assert first_frame_stands_apart(replace(clip, rotations=rotations)) is apart


def test_a_motion_that_starts_at_once_keeps_its_first_frame():
    assert parse(format_bvh(walker())).rest is None


@pytest.mark.parametrize("name", SKELETONS)
@pytest.mark.parametrize(("unit", "up"), [("cm", "y"), ("m", "z"), ("in", "y"), ("mm", "z")])
def test_writing_and_reading_gives_the_same_joints(name, unit, up, tmp_path):
    clip = tumbling(SKELETONS[name], 60)
    path = tmp_path / "a.bvh"
    write_bvh(path, clip, unit=unit, up=up)
    read = read_bvh(path, unit=unit, up=up)
    order = [read.skeleton.joint_names.index(n) for n in clip.skeleton.joint_names]
    assert np.abs(read.joints()[:, order] - clip.joints).max() < 2e-5
    assert read.fps == 60
    assert list(tmp_path.iterdir()) == [path], "no part is left behind"


def test_a_written_file_says_what_the_contract_says():
    lines = format_bvh(walker(fps=24000 / 1001)).splitlines()
    assert lines[:5] == [
        "HIERARCHY",
        "ROOT pelvis",
        "{",
        "\tOFFSET 0.000000 0.000000 0.000000",
        "\tCHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation",
    ]
    assert "\t\tCHANNELS 3 Zrotation Yrotation Xrotation" in lines
    assert "Frame Time: 0.04170833" in lines
    knee = lines.index("\t\tJOINT L_knee")
    assert lines[knee + 2] == "\t\t\tOFFSET 0.000000 -39.000000 0.000000", "centimetres of the T-pose"
    assert not any("#" in line for line in lines)


def test_zero_rotations_are_the_t_pose():
    read = parse(format_bvh(walker()))
    zero = np.tile([1.0, 0, 0, 0], (1, 22, 1))
    joints = forward_kinematics(read.skeleton, zero, np.zeros((1, 3)))[0]
    order = [read.skeleton.joint_names.index(n) for n in HUMANML3D.joint_names]
    np.testing.assert_allclose(joints[order], HUMANML3D.rest - HUMANML3D.rest[0], atol=1e-6)


def test_channels_do_not_jump_between_frames():
    clip = walker(turn=2.0, seconds=8)
    assert np.abs(np.diff(to_euler(clip.rotations, "ZYX"), axis=0)).max() > 170
    text = format_bvh(clip)
    values = np.array([line.split() for line in text.splitlines()[-clip.frames :]], float)[:, 3:]
    assert np.abs(np.diff(values, axis=0)).max() < 45


def test_names_that_would_break_the_file_are_mended():
    skeleton = type(KIT)("x", ("a {b}", "c\nd"), (-1, 0), np.ones((2, 3), np.float32), (0, 1))
    clip = MotionClip.of(skeleton, np.tile([1.0, 0, 0, 0], (2, 2, 1)), np.zeros((2, 3)), np.zeros((2, 4)), 30)
    assert parse(format_bvh(clip)).skeleton.joint_names == ("a_b_", "c_d")


def test_writing_into_a_folder_that_is_not_there_leaves_nothing(tmp_path):
    with pytest.raises(InvalidInput, match=r"a\.bvh: cannot be written"):
        write_bvh(tmp_path / "none" / "a.bvh", walker())
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_survives_a_clip_that_cannot_be_written(tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text("old")
    clip = walker()
    clip.root[3] = np.nan
    with pytest.raises(InvalidInput, match=r"^humanml3d: .*NaN"):
        write_bvh(path, clip)
    assert path.read_text() == "old"


BROKEN = {
    "empty": ("", 1, "ends before MOTION"),
    "not bvh": ("{}\n", 1, "HIERARCHY"),
    "binary": ("HIERARCHY\0\0", 1, "not text"),
    "no motion": (SMALL[: SMALL.index("MOTION")], 16, "ends before MOTION"),
    "brace missing": (SMALL.replace("\t}\n}\n", "\t}\n"), 15, "MOTION before"),
    "brace too many": (SMALL.replace("}\nMOTION", "}\n}\nMOTION"), 16, "never opened"),
    "unknown word": (SMALL.replace("\t\tOFFSET 0.0 20", "\t\tOFSET 0.0 20"), 8, "OFSET"),
    "offset short": (SMALL.replace("0.0 20.0 0.0", "0.0 20.0"), 8, "three numbers"),
    "offset a word": (SMALL.replace("0.0 20.0 0.0", "0.0 abc 0.0"), 8, "abc"),
    "offset infinite": (SMALL.replace("0.0 20.0 0.0", "0.0 inf 0.0"), 8, "finite"),
    "unknown channel": (SMALL.replace("3 Zrotation X", "3 Zrotation W"), 9, "Wrotation"),
    "channels missing": (SMALL.replace("3 Zrotation Xrotation Yrotation", "3 Zrotation Xrotation"), 9, "2 named"),
    "channel count": (SMALL.replace("CHANNELS 3", "CHANNELS many"), 9, "many"),
    "too many channels": (SMALL.replace("CHANNELS 3", "CHANNELS 7"), 9, "7 channels; allowed: 0 to 6"),
    "second root": (SMALL.replace("MOTION", "ROOT b\n{\n}\nMOTION"), 16, "second ROOT"),
    "joint outside": (SMALL.replace("ROOT", "JOINT"), 2, "outside"),
    "joint in end site": (SMALL.replace("\t\t\tOFFSET 0.0 30.0 0.0", "\t\t\tJOINT x"), 12, "inside of an End Site"),
    "no frames line": (SMALL.replace("Frames: 2\n", ""), 17, "Frames:"),
    "frames a word": (SMALL.replace("Frames: 2", "Frames: two"), 17, "two"),
    "frames negative": (SMALL.replace("Frames: 2", "Frames: -2"), 17, "-2"),
    "no frame time": (SMALL[: SMALL.index("Frame Time")], 18, "Frame Time"),
    "frame time zero": (SMALL.replace("0.0333333", "0"), 18, "frame time"),
    "frame time empty": (SMALL.replace("0.0333333", " "), 18, "not a number"),
    "frame time nan": (SMALL.replace("0.0333333", "nan"), 18, "finite"),
    "frame time comma": (SMALL.replace("0.0333333", "0,0333333"), 18, "0,0333333"),
    "word in motion": (SMALL.replace("1 91 2", "1 x91 2"), 20, "x91"),
    "huge in motion": (SMALL.replace("1 91 2", "1 1e300 2"), 20, "too large"),
    "offset huge": (SMALL.replace("0.0 20.0 0.0", "0.0 1e300 0.0"), 8, "too large"),
    "nan in motion": (SMALL.replace("1 91 2", "1 nan 2"), 20, "nan"),
    "cut off": (SMALL[:-10], 20, "needs? 9"),
    "a number too many": (SMALL.replace("1 90 2 90", "1 90 2 90 5"), 19, "10 numbers"),
    "a number missing, and one too many": (
        SMALL.replace("1 90 2 90 0 0 0 90 0\n1 91", "1 90 2 90 0 0 0 90\n0 1 91"),
        19,
        "8 numbers; the channels need 9",
    ),
    "a number too many, and one missing": (
        SMALL.replace("0 90 0\n1 91", "0 90 0 1\n91"),
        19,
        "10 numbers; the channels need 9",
    ),
    "no numbers": (SMALL[: SMALL.index("1 90 2")], None, "no frames"),
    "no channels": (
        SMALL.replace("\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n", "").replace(
            "\t\tCHANNELS 3 Zrotation Xrotation Yrotation\n", ""
        ),
        None,
        "no joint has channels",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_gets_an_error_with_its_line(name):
    text, line, message = BROKEN[name]
    with pytest.raises(InvalidFile, match=message) as caught:
        parse(text)
    assert caught.value.where is not None
    assert caught.value.where.startswith("a.bvh, line ")
    if line is not None:
        assert caught.value.where == f"a.bvh, line {line}"


@pytest.mark.parametrize(("number", "line"), [("1e9", 20), ("-1000000000", 20), ("1.0001e9", 19), ("nan", 19)])
def test_the_first_number_over_the_limit_is_told_and_one_at_it_is_none(number: str, line: int) -> None:
    text = SMALL.replace("1 90 2 90 0", f"{number} 90 2 90 0")
    if line == 20:
        assert abs(parse(text, unit="m").root[0, 0]) == 1e9
    with pytest.raises(InvalidFile, match="is not a number, not finite or too large") as refused:
        parse(text.replace("1 91 2", "1 91 2e99"))
    assert refused.value.where == f"a.bvh, line {line}"


def test_a_missing_file_is_not_found_and_a_folder_is_no_file(tmp_path):
    for error, message, path in (
        (NotFound, "no such file", tmp_path / "none.bvh"),
        (InvalidFile, "cannot be read", tmp_path),
    ):
        with pytest.raises(error, match=f"^{re.escape(str(path))}: {message}"):
            read_bvh(path)


def test_sizes_are_bounded(tmp_path, monkeypatch):
    with monkeypatch.context() as small:
        small.setattr(bvh, "MAX_BYTES", 100)
        with pytest.raises(TooLarge, match="MiB, over the limit"):
            parse(SMALL)
    path = tmp_path / "a.bvh"
    path.write_text(SMALL)
    monkeypatch.setattr(bvh, "MAX_FRAMES", 1)
    with pytest.raises(TooLarge, match="2 frames"):
        read_bvh(path)
    monkeypatch.setattr(bvh_header, "MAX_JOINTS", 1)
    with pytest.raises(TooLarge, match="line 6"):
        read_bvh(path)
    monkeypatch.setattr(bvh, "MAX_BYTES", 100)
    with pytest.raises(TooLarge, match="MiB"):
        read_bvh(path)


def test_as_many_joints_as_are_allowed_can_be_read_and_written():
    depth = bvh_header.MAX_JOINTS
    text = "HIERARCHY\n" + "".join(
        f"{'JOINT' if d else 'ROOT'} j{d}\n{{\nOFFSET 0 1 0\nCHANNELS 1 Xrotation\n" for d in range(depth)
    )
    text += "}\n" * depth + "MOTION\nFrames: 1\nFrame Time: 0.1\n" + "1 " * depth
    clip = parse(text)
    np.testing.assert_allclose(parse(format_bvh(clip)).joints(), clip.joints(), atol=1e-6)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_no_damage_to_a_file_gives_anything_but_a_clip_or_an_expected_error(data):
    text = bytearray(SMALL.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        what = data.draw(st.sampled_from(["drop", "byte", "cut", "twice"]))
        if what == "drop":
            del text[at : at + data.draw(st.integers(1, 12))]
        elif what == "byte":
            text[at : at + 1] = data.draw(st.binary(max_size=3))
        elif what == "cut":
            del text[at + 1 :]
        else:
            text[at:at] = text[at : at + 20]
        if not text:
            break
    with contextlib.suppress(InvalidFile, TooLarge):
        assert np.isfinite(parse_bvh(bytes(text)).joints()).all()


def test_the_text_form_of_a_file_leaves_its_arrays_out() -> None:
    text = repr(parse_bvh(format_bvh(tumbling(HUMANML3D, 20.0)).encode()))
    assert "array" not in text.replace(repr(HUMANML3D), "")
    assert "fps=" in text


def test_a_file_of_as_many_frames_as_may_be_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    clip = tumbling(HUMANML3D, 20.0)
    data = format_bvh(clip).encode()
    monkeypatch.setattr(bvh, "MAX_FRAMES", clip.frames)
    assert len(parse_bvh(data).rotations) == clip.frames
    monkeypatch.setattr(bvh, "MAX_FRAMES", clip.frames - 1)
    with pytest.raises(TooLarge):
        parse_bvh(data)


def test_units_are_told_in_metres() -> None:
    assert METRES == {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}


def test_bones_at_the_ends_have_the_size_of_what_they_stand_for() -> None:
    """Of a head, a hand and toes, which have no joint at their tip."""
    lines = format_bvh(walker(seconds=0.1)).splitlines()
    ends = {lines[at - 4].split()[-1]: lines[at + 2].split()[1:] for at, line in enumerate(lines) if "End Site" in line}
    lengths = {name: np.linalg.norm(np.array(offset, float)) for name, offset in ends.items()}
    assert set(lengths) == {"L_foot", "R_foot", "head", "L_wrist", "R_wrist"}
    for name, length in lengths.items():
        assert (2 < length < 9) if "foot" in name else (10 < length < 25)
