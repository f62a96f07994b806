"""`marey edit`: operations in the order of the command line, files in and out."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from marey.cli.commands.edit import _report
from marey.cli.main import app
from marey.cli.operations import with_operations
from marey.cli.roles.editing import loop
from marey.core.errors import InvalidInput
from marey.core.sides import swap_sides, swap_sides_in
from marey.editing.judge import judged
from marey.motion import edit, load_npz, read_fbx, read_glb
from marey.motion.arrange import placement_of
from marey.motion.clip import MotionClip
from marey.motion.edits.table import OPERATIONS
from marey.motion.feet import clean_feet
from marey.motion.io.bvh import read_bvh
from marey.motion.pose import solve_pose
from marey.motion.skeleton import HUMANML3D
from marey.quality.clips import quality_of
from marey.quality.limits import Expected
from marey.quality.record import Flag
from tests.support import bodies
from tests.support.walker import walker


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    clip = walker(seconds=3.0, turn=0.5, prompt="a person walks and raises the left hand")
    clip.save_npz(tmp_path / "walk.npz")
    return tmp_path / "walk.npz"


def run(*args: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, ["edit", *map(str, args)])
    assert result.exit_code == code, result.output
    return result.output


def test_operations_apply_in_the_order_of_the_line(walk: Path):
    first, second = walk.with_name("a.npz"), walk.with_name("b.npz")
    run(walk, "-o", first, "--trim", "0:1", "--reverse")
    run(walk, "-o", second, "--reverse", "--trim=0:1")
    a, b, source = load_npz(first), load_npz(second), load_npz(walk)
    assert a.frames == b.frames == 21
    turn, shift = placement_of(a)
    assert placement_of(b)[1][2] > shift[2] + 0.5  # from the end of the walk, not from 1 s
    assert [each["op"] for each in b.manifest["edited_from"]["ops"]] == ["reverse", "trim"]
    assert a.manifest["edited_from"]["sources"][0]["name"] == "walk.npz"
    assert np.abs(source.root[20] - shift)[[0, 2]].max() < 1e-4
    assert turn[0] < 1


def test_an_option_of_an_operation_acts_on_the_one_before_it(walk: Path):
    out = walk.with_name("out.npz")
    run(walk, "-o", out, "--concat", walk, "--blend", "0.5", "--concat", walk, "--blend=0", "--mirror")
    ops = load_npz(out).manifest["edited_from"]["ops"]
    assert [each.get("blend") for each in ops] == [0.5, 0.0, None]
    said = run(walk, "-o", walk.with_name("x.npz"), "--blend", "0.2", "--concat", walk, code=2)
    assert "--blend: belongs to no operation before it" in said


def test_pieces_are_numbered_and_fit_where_they_were(walk: Path):
    run(walk, "-o", walk.with_name("piece.bvh"), "--split", "f20", "--placement", "keep")
    first, second = (read_bvh(walk.with_name(f"piece-{number}.bvh")) for number in (1, 2))
    np.testing.assert_allclose(first.joints()[-1, 0], second.joints()[0, 0], atol=1e-4)


def test_several_motions_go_into_a_folder(walk: Path):
    other = walk.with_name("other.npz")
    other.write_bytes(walk.read_bytes())
    lines = run(walk, other, "-o", walk.with_name("edited"), "--format", "glb", "--mirror", "--json").splitlines()
    rows = [json.loads(line) for line in lines if line.startswith("{")]
    assert [Path(row["file"]).name for row in rows] == ["walk.glb", "other.glb"]
    assert rows[0]["quality"]["support"] == ["feet"]
    assert "right hand" in read_glb(walk.parent / "edited" / "walk.glb").manifest["prompt"]
    assert "is one file for 2 motions" in run(walk, other, "-o", walk.with_name("one.npz"), "--mirror", code=2)


def test_a_file_of_operations_is_the_same(walk: Path):
    ops = walk.with_name("ops.json")
    ops.write_text(json.dumps([{"op": "trim", "from": 0.5}, {"op": "in-place"}]))
    run(walk, "-o", walk.with_name("a.npz"), "--ops", ops)
    run(walk, "-o", walk.with_name("b.npz"), "--trim", "0.5:", "--in-place", "travel")
    assert walk.with_name("a.npz").read_bytes() == walk.with_name("b.npz").read_bytes()
    assert "cannot be combined" in run(walk, "-o", walk.with_name("c.npz"), "--ops", ops, "--mirror", code=2)
    ops.write_text('{"op": "mirror"')
    assert "ops.json" in run(walk, "-o", walk.with_name("c.npz"), "--ops", ops, code=2)


def test_nothing_is_written_when_something_cannot_be_done(walk: Path):
    out = walk.with_name("out.npz")
    assert "no operation is given" in run(walk, "-o", out, code=2)
    assert "after the end" in run(walk, "-o", out, "--trim", "1:9", code=2)
    assert "'1' is not A:B" in run(walk, "-o", out, "--trim", "1", code=2)
    assert "no such file" in run(walk, "-o", out, "--concat", walk.with_name("none.npz"), code=3)
    assert "two motions would have this name" in run(walk, walk, "-o", walk.with_name("twice"), "--mirror", code=2)
    out.write_text("mine")
    assert "already exists" in run(walk, "-o", out, "--mirror", code=2)
    assert out.read_text() == "mine"
    assert sorted(path.name for path in walk.parent.iterdir()) == ["out.npz", "walk.npz"]


def test_of_several_motions_the_one_that_cannot_be_edited_is_named(walk: Path):
    short = walk.with_name("short.npz")
    run(walk, "-o", short, "--trim", ":0.3")
    said = run(walk, short, "-o", walk.with_name("cut"), "--trim", "1:", code=2)
    assert f"marey: {short}: --trim 1:: 1 s is after the end" in said


def test_an_output_with_the_name_of_an_option_is_not_taken_for_it(walk: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(walk.parent)
    Path("loop").write_text("a file")
    assert "marey: loop: cannot write here" in run(walk, "-o", "loop/a.npz", "--mirror", code=2)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--split", "99"), "marey: --split 99: 99 s is after the end of the motion"),
        (("--mirror", "--trim=1:9"), "marey: --trim 1:9: 9 s is after the end of the motion"),
        (("--trim", "0:0.1", "--loop"), "marey: --loop: "),
        (("--mirror", "--speed", "99"), "marey: --speed 99: 99.0 is not a number from 0.1 to 10"),
        (("--concat", "walk.npz", "--blend", "9"), "marey: --blend 9: 9.0 is not a number from 0 to 2"),
    ],
)
def test_an_error_names_the_option_that_was_given(walk: Path, given: tuple[str, ...], said: str):
    words = (walk if word == "walk.npz" else word for word in given)
    assert said in run(walk, "-o", walk.with_name("out.npz"), *words, code=2)


def test_an_error_names_the_number_in_a_file_of_operations(walk: Path):
    ops = walk.with_name("ops.json")
    for rows, said in (
        ([{"op": "mirror"}, {"op": "trim", "to": 9}], "operation 2: 9 s is after the end of the motion"),
        ([{"op": "speed", "factor": 99}], "operation 1, factor: 99 is not a number"),
        ([{"op": "explode"}], "operation 1, op: unknown operation"),
    ):
        ops.write_text(json.dumps(rows))
        assert f"marey: {ops}: {said}" in run(walk, "-o", walk.with_name("out.npz"), "--ops", ops, code=2)


def test_a_motion_in_place_is_not_flagged_for_its_sliding_feet():
    joints, contacts = clean_feet(bodies.walker(turn=0), HUMANML3D, 20.0)
    pose = solve_pose(joints, HUMANML3D, fps=20.0)
    walk = MotionClip.of(pose.skeleton, pose.rotations, pose.root, contacts, 20.0)
    (still,) = edit(walk, [{"op": "in-place"}])
    measured = quality_of(still, Expected())
    assert measured is not None
    assert measured.flags == [Flag.SKATING]
    assert judged(still).manifest["quality"]["flags"] == []
    carried = MotionClip.of(  # it travels again, by another way than its feet
        walk.skeleton, walk.rotations, 2 * walk.root * [1, 0.5, 1], contacts, 20.0, manifest=still.manifest
    )
    assert judged(carried).manifest["quality"]["flags"] == ["skating"]


def test_every_operation_of_the_table_has_its_option():
    def command(**operations: object) -> None: ...

    import inspect

    given = inspect.signature(with_operations(command)).parameters
    assert {f"{name.replace('-', '_')}_" for name in OPERATIONS} <= set(given)


def test_the_quality_of_a_result_is_measured_anew():
    clip = walker(seconds=4.0)
    (mirrored,) = edit(clip, [{"op": "mirror"}])
    assert judged(mirrored).manifest["quality"]["match"]["value"] is not None
    (lifted,) = edit(clip, [{"op": "concat", "with": walker(prompt="a person bows")}])
    record = judged(lifted).manifest["quality"]
    assert record["match"]["value"] is None  # two prompts
    assert judged(edit(walker(seconds=0.1), [{"op": "mirror"}])[0]).manifest.get("quality") is None


@pytest.mark.parametrize(
    ("text", "swapped"),
    [
        ("turns left, then RIGHT", "turns right, then LEFT"),
        ("Left-handed, upright, bright", "Right-handed, upright, bright"),
        ("walk-turn-left", "walk-turn-right"),
        ("leftwards and clockwise", "rightwards and counterclockwise"),
    ],
)
def test_left_and_right_are_exchanged_in_words(text: str, swapped: str):
    assert swap_sides(text) == swapped
    assert swap_sides(swapped) == text
    assert swap_sides_in({"left": [text, 1, None]}) == {"left": [swapped, 1, None]}


def test_a_loop_on_the_skeleton_of_a_character(walk: Path) -> None:
    run(walk, "-o", walk.with_name("loop.fbx"), "--loop", "--in-place", "travel", "--rig", "mixamo")
    cycle = read_fbx(walk.with_name("loop.fbx"))
    assert any(name.endswith("LeftUpLeg") for name in cycle.skeleton.joint_names)
    assert len(cycle.root) < load_npz(walk).frames


def test_a_generated_motion_without_a_cycle_is_named(walk: Path) -> None:
    clip = load_npz(walk)
    assert loop(clip, "'walk', seed 3").manifest["loop"]
    short = edit(clip, [{"op": "trim", "to": 0.3}])[0]
    with pytest.raises(InvalidInput) as caught:
        loop(short, "'walk', seed 3")
    assert caught.value.where == "'walk', seed 3"
    assert "another seed" in str(caught.value.hint)


def test_an_ending_of_two_parts_names_its_own_format(walk: Path) -> None:
    said = run(walk, "-o", walk.with_name("a.smplx.npz"), "--mirror", code=2)
    assert "SMPL-X model" in said
    assert not walk.with_name("a.smplx.npz").exists()


def test_a_prompt_that_the_model_does_not_know_is_refused_before_anything_is_generated(walk: Path) -> None:
    out = walk.with_name("out.npz")
    edits = ("--extend", "1", "--prompt", "asdf qwer zxcv", "--bundle", "hgm3-starter")
    said = run(walk, "-o", out, *edits, "--scope", "refuse", code=2)
    assert "names an action that the model does not know: 'asdf qwer" in said
    assert not out.exists()


def test_flags_are_told_with_the_file_as_it_was_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    flags = ["self-contact", "skating", "off-prompt"]
    _report({"file": str(tmp_path / "e4.npz"), "quality": {"flags": flags}})
    assert capsys.readouterr().err == "e4.npz: the motion has the flags self-contact, skating.\n"
    _report({"file": str(tmp_path / "e4.npz"), "quality": {"flags": ["off-prompt"]}})
    assert capsys.readouterr().err == ""
