"""Contact sheets: what can be seen on them."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.kinematics import global_rotations
from marey.motion.rotations import conjugate, multiply, normalize, rotate, to_matrix
from marey.motion.skeleton import HUMANML3D, KIT, SKELETONS, SNAPMOGEN, Skeleton
from marey.viz.body import dress, dress_clip, forward_of, part_of
from marey.viz.paper import THEMES, Paper, one_line
from marey.viz.raster import Camera, shade
from marey.viz.render import CELL, GAP, MARGIN, PLAN, contact_sheet, facts_of
from tests.support.walker import walker

STRIP = 60  # pixels from the sheet's top to the first strip of a sheet with one line of caption and no title


@pytest.fixture(scope="module")
def clip():
    return walker()


def drawn(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def cell(sheet: NDArray[np.uint8], column: int, row_top: int = STRIP) -> NDArray[np.int16]:
    left = MARGIN + column * CELL[0]
    return sheet[row_top : row_top + CELL[1], left : left + CELL[0]].astype(np.int16)


def bluish(picture: NDArray[np.int16]) -> NDArray[np.bool_]:
    return picture[..., 2] - picture[..., 0] > 60


def orangish(picture: NDArray[np.int16]) -> NDArray[np.bool_]:
    return picture[..., 0] - picture[..., 2] > 60


def shaded(ends: NDArray, radii: NDArray, colours: NDArray, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Round cones as an RGBA picture: alpha is 255 where there is one."""
    picture = np.zeros((size[1], size[0], 4), np.uint8)
    shown = shade(ends, radii, colours, size)
    picture[shown.rows, shown.columns] = np.concatenate([shown.colours, np.full((len(shown.rows), 1), 255, "u1")], -1)
    return picture


def centre(mask: NDArray[np.bool_]) -> tuple[float, float]:
    rows, columns = np.nonzero(mask)
    return float(columns.mean()), float(rows.mean())


def test_a_clip_becomes_a_strip_of_different_poses(clip, tmp_path):
    sheet = drawn(contact_sheet(clip, tmp_path / "a.png", columns=5))
    assert sheet.shape[1] > 5 * CELL[0]
    poses = [cell(sheet, k) for k in range(5)]
    for before, after in pairwise(poses):
        assert (bluish(before) ^ bluish(after)).sum() > 200
        assert (orangish(before) ^ orangish(after)).sum() > 200


def test_the_left_side_is_blue_and_seen_from_the_front_on_the_right(clip, tmp_path):
    pose = cell(drawn(contact_sheet(clip, tmp_path / "a.png", columns=4)), 0)
    assert centre(bluish(pose))[0] > centre(orangish(pose))[0] + 5
    top = [np.nonzero(side(pose))[0].min() for side in (bluish, orangish)]
    assert top[0] < top[1] - 20  # the raised hand is the left one


def test_a_figure_that_turned_round_shows_its_left_on_the_left(tmp_path):
    turned = walker(turn=np.pi / 2, seconds=2)  # half a turn to the left
    sheet = drawn(contact_sheet(turned, tmp_path / "a.png", columns=4))
    assert centre(bluish(cell(sheet, 3)))[0] < centre(orangish(cell(sheet, 3)))[0] - 5


def test_feet_in_contact_light_the_floor(clip, tmp_path):
    lit = drawn(contact_sheet(replace(clip, contacts=np.ones_like(clip.contacts)), tmp_path / "a.png"))
    dark = drawn(contact_sheet(replace(clip, contacts=np.zeros_like(clip.contacts)), tmp_path / "b.png"))
    changed = (lit != dark).any(axis=-1)
    for column in range(8):
        patch = cell(changed, column).astype(bool)
        assert patch.any()
        assert np.nonzero(patch)[0].min() > CELL[1] / 2


def test_several_clips_are_rows_of_one_sheet(clip, tmp_path):
    one = drawn(contact_sheet(clip, tmp_path / "a.png"))
    three = drawn(contact_sheet([clip, walker(turn=0.8), clip], tmp_path / "b.png"))
    assert three.shape[1] == one.shape[1]
    row = one.shape[0] - (MARGIN - 8) - 46
    assert three.shape[0] == one.shape[0] + 2 * (row + GAP)
    np.testing.assert_array_equal(cell(three, 2), cell(one, 2))
    np.testing.assert_array_equal(cell(three, 2, STRIP + 2 * (row + GAP)), cell(one, 2))


def test_chosen_frames_are_the_ones_drawn(clip, tmp_path):
    chosen = drawn(contact_sheet(clip, tmp_path / "a.png", frames=[0, 40]))
    ends = drawn(contact_sheet(clip, tmp_path / "b.png", columns=2))
    np.testing.assert_array_equal(chosen, ends)


def test_the_same_clip_gives_the_same_bytes(clip, tmp_path):
    a, b = contact_sheet(clip, tmp_path / "a.png"), contact_sheet(clip, tmp_path / "b.png")
    assert a.read_bytes() == b.read_bytes()


def test_the_plan_draws_a_left_turn_to_the_left(tmp_path):
    ink = np.array(THEMES["light"].ink)
    for turn in (0.6, -0.6):
        sheet = drawn(contact_sheet(walker(turn=turn, seconds=2), tmp_path / "a.png", captions=[""]))
        plan = sheet[STRIP : STRIP + CELL[1] - 30, -MARGIN - PLAN : -MARGIN].astype(int)
        rows, columns = np.nonzero(np.abs(plan - ink).max(axis=-1) < 30)  # the arrows along the path
        end, start = columns[rows < rows.min() + 20].mean(), columns[rows > rows.max() - 20].mean()
        assert (start - end) * turn > 10


def test_one_frame_is_drawn_once(tmp_path):
    still = walker(seconds=0)
    assert len(still.joints) == 1
    sheet = drawn(contact_sheet(still, tmp_path / "a.png"))
    assert bluish(cell(sheet, 0)).sum() > 500


@pytest.mark.parametrize("prompt", ["", "a\nb\x00c\x1b[31m", "🕺 踊る " * 40, "word" * 400, "w " * 4000])
def test_any_prompt_can_stand_on_a_sheet(prompt, tmp_path):
    contact_sheet(walker(seconds=0.5, prompt=prompt), tmp_path / "a.png", columns=2, title=prompt)


def test_a_sheet_says_where_a_motion_comes_from(clip):
    trained = {"seed": 7, "bundle": "hgm3-starter", "licence": "CC BY-NC 4.0", "random_weights": False}
    line = "2.0 s  ·  41 frames at 20 fps  ·  seed 7  ·  hgm3-starter  ·  CC BY-NC 4.0"
    assert facts_of(replace(clip, manifest=trained)) == line
    assert facts_of(replace(clip, manifest=trained | {"random_weights": True})) == line + "  ·  RANDOM WEIGHTS"
    assert facts_of(replace(clip, manifest={})) == "2.0 s  ·  41 frames at 20 fps"


def test_a_dark_sheet_is_dark(clip, tmp_path):
    assert drawn(contact_sheet(clip, tmp_path / "a.png", theme="dark")).mean() < 60


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"theme": "pink"}, "unknown theme 'pink'"),
        ({"columns": 0}, "0 columns"),
        ({"columns": 1000}, "1000 columns"),
        ({"frames": [3, 41]}, r"frames \[41\] are not in a clip of 41"),
        ({"frames": []}, "no frames"),
        ({"captions": ["a", "b"]}, "2 captions for 1 clips"),
    ],
)
def test_an_option_that_cannot_be_is_refused(clip, tmp_path, options, message):
    with pytest.raises(InvalidInput, match=message):
        contact_sheet(clip, tmp_path / "a.png", **options)
    assert not list(tmp_path.iterdir())


def test_a_body_in_a_wrong_unit_is_drawn_and_a_single_joint_refused(tmp_path):
    """Around a body of kilometres the grid would have millions of lines."""
    clip = walker(seconds=0.2)
    large = Skeleton("x", HUMANML3D.joint_names, HUMANML3D.parents, HUMANML3D.offsets * 1e5, HUMANML3D.mirror)
    began = time.monotonic()
    contact_sheet(MotionClip.of(large, clip.rotations, clip.root * 1e5, clip.contacts, 20.0), tmp_path / "a.png")
    assert time.monotonic() - began < 10
    joint = Skeleton("one", ("hips",), (-1,), np.zeros((1, 3), np.float32), (0,))
    still = MotionClip.of(joint, clip.rotations[:, :1], clip.root, clip.contacts, 20.0)
    with pytest.raises(InvalidInput, match="no bones that could be drawn"):
        contact_sheet(still, tmp_path / "b.png")


def test_no_clip_a_foreign_ending_and_a_missing_folder_are_refused(clip, tmp_path):
    with pytest.raises(InvalidInput, match="no clip"):
        contact_sheet([], tmp_path / "a.png")
    with pytest.raises(InvalidInput, match=r"\.png, not \.jpg"):
        contact_sheet(clip, tmp_path / "a.jpg")
    with pytest.raises(InvalidInput, match=r"missing/a\.png: cannot be written: No such file"):
        contact_sheet(clip, tmp_path / "missing" / "a.png")


@pytest.mark.parametrize("skeleton", SKELETONS.values(), ids=lambda s: s.name)
def test_every_skeleton_gets_a_body_with_two_equal_sides_a_face_and_feet(skeleton: Skeleton):
    body = dress(skeleton)
    sides = {part: [limb for limb in body.limbs if limb.part == part] for part in ("left", "right", "middle", "face")}
    assert len(sides["left"]) == len(sides["right"]) >= 8
    assert len(sides["face"]) == 1
    left, right = (np.sort([(s.start_radius, s.end_radius) for s in sides[p]], axis=0) for p in ("left", "right"))
    np.testing.assert_allclose(left, right, atol=2e-5)  # as far apart as the sides of SnapMoGen's rig
    assert body.height == pytest.approx(np.ptp(skeleton.rest[:, 1]) * (1 + 0.2 / 1.5), rel=1e-3)


def test_the_nose_points_where_the_figure_faces_and_the_head_is_on_top():
    joints, axes = HUMANML3D.rest[None], np.broadcast_to(np.eye(3), (1, 22, 3, 3))
    body = dress(HUMANML3D)
    ends = body.points(joints, axes)[0]
    face = next(k for k, limb in enumerate(body.limbs) if limb.part == "face")
    head = HUMANML3D.rest[HUMANML3D.index("head")]
    assert ends[face, :, 2].min() > head[2] + 0.05
    assert ends[..., 1].max() > head[1] + 0.1


@pytest.mark.parametrize(
    ("skeleton", "left", "right", "middle"),
    [
        (HUMANML3D, "L_knee", "R_wrist", "spine3"),
        (KIT, "LK", "RW", "BT"),
        (SNAPMOGEN, "L_foot0001_bind_JNT", "R_hand0001_bind_JNT", "C_head_bind_JNT"),
    ],
)
def test_sides_are_read_from_names(skeleton, left, right, middle):
    parts = [part_of(skeleton, skeleton.index(name)) for name in (left, right, middle)]
    assert parts == ["left", "right", "middle"]


def test_limbs_end_at_the_joints_of_the_pose(clip):
    body = dress(clip.skeleton)
    axes = to_matrix(global_rotations(clip.skeleton, clip.rotations))
    ends = body.points(clip.joints, axes)
    for k, limb in enumerate(body.limbs[:21]):  # the bones proper: one a joint but the root
        np.testing.assert_allclose(ends[:, k, 1], clip.joints[:, limb.end], atol=1e-6)
        assert clip.skeleton.parents[limb.end] == limb.start


def test_a_foreign_body_is_measured_where_it_stands(clip):
    """Rest poses of foreign files may be anything: here every joint has other axes, and nothing is known by name."""
    random = np.random.default_rng(2)
    axes = normalize(random.normal(0, 1, (22, 4)))  # new world rotation = old one, then these
    world = multiply(global_rotations(clip.skeleton, clip.rotations), axes)
    parents = [max(p, 0) for p in clip.skeleton.parents]
    local = multiply(conjugate(world[:, parents]), world)
    local[:, 0] = world[:, 0]
    offsets = rotate(conjugate(axes[parents]), clip.skeleton.offsets)
    foreign = replace(clip.skeleton, name="foreign", offsets=offsets.astype(np.float32), feet=(), facing=())
    moved = MotionClip.of(foreign, local, clip.root, clip.contacts, clip.fps)
    np.testing.assert_allclose(moved.joints, clip.joints, atol=1e-5)

    bodies = dress(clip.skeleton), dress_clip(moved)
    ends = [
        body.points(c.joints, to_matrix(global_rotations(c.skeleton, c.rotations)))
        for body, c in zip(bodies, (clip, moved), strict=True)
    ]
    assert bodies[1].height == pytest.approx(bodies[0].height, abs=0.05)
    for part in ("face", "left", "right"):
        first, second = (
            [e[:, k] for k, limb in enumerate(body.limbs) if limb.part == part]
            for body, e in zip(bodies, ends, strict=True)
        )
        for limb, other in zip(first[:7], second, strict=True):  # all but the soles, which want known feet
            assert np.linalg.norm(limb - other, axis=-1).max() < 0.03
    np.testing.assert_allclose(forward_of(foreign, clip.joints[0]), [0, 0, 1], atol=1e-3)


def test_small_branches_of_the_trunk_are_no_arms():
    """Eyes, for one: pairs beside the head, which must not grow hands nor make a chest of the head."""
    tree = HUMANML3D
    head = tree.index("head")
    eyed = Skeleton(
        "eyed",
        (*tree.joint_names, "L_eye", "R_eye"),
        (*tree.parents, head, head),
        np.concatenate([tree.offsets, [[0.03, 0, 0.08], [-0.03, 0, 0.08]]]).astype(np.float32),
        (*tree.mirror, 23, 22),
        tree.feet,
        tree.facing,
    )
    plain, body = dress(tree), dress(eyed)
    assert [limb for limb in body.limbs if limb.end not in (22, 23)] == list(plain.limbs)
    assert len(body.limbs) == len(plain.limbs) + 2
    assert all(limb.end_radius < 0.02 for limb in body.limbs if limb.end in (22, 23))


def test_a_ball_is_a_disc_with_the_light_from_above():
    ends = np.array([[[50, 50, 0], [50, 50, 0]]], np.float32)
    picture = shaded(ends, np.full((1, 2), 20, np.float32), np.full((1, 3), 0.6, np.float32), (100, 100))
    y, x = np.mgrid[:100, :100] + 0.5
    inside = np.hypot(x - 50, y - 50)
    assert (picture[..., 3][inside < 19.5] == 255).all()
    assert (picture[..., 3][inside > 20.5] == 0).all()
    assert picture[34, 50, 0] > picture[66, 50, 0] + 30


@pytest.mark.parametrize("seed", range(6))
def test_a_round_cone_is_the_union_of_its_balls(seed):
    """Its outline is where any ball between its ends lies, whatever the view: also along the axis."""
    random = np.random.default_rng(seed)
    spread = [22, 22, 60] if seed % 2 else [2, 2, 22]
    ends = np.array([40.0, 60, 0]) + random.normal(0, 1, (2, 3)) * spread
    radii = random.uniform(4, 16, 2)
    picture = shaded(ends[None].astype(np.float32), radii[None].astype(np.float32), np.ones((1, 3), "f4"), (90, 120))
    y, x = np.mgrid[:120, :90] + 0.5
    share = np.linspace(0, 1, 400)[:, None, None]
    (ax, ay, _), (bx, by, _) = ends
    gap = np.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay)) - (radii[0] + share * (radii[1] - radii[0]))
    union = gap.min(axis=0)
    assert (picture[..., 3][union < -0.6] == 255).all()
    assert (picture[..., 3][union > 0.6] == 0).all()


def test_what_is_nearer_hides_what_is_behind():
    ends = np.array([[[30, 50, 10], [70, 50, 10]], [[50, 30, -10], [50, 70, -10]]], np.float32)
    colours = np.array([[1, 0, 0], [0, 0, 1]], np.float32)
    for order in ([0, 1], [1, 0]):
        picture = shaded(ends[order], np.full((2, 2), 6, np.float32), colours[order], (100, 100))
        assert picture[50, 50, 0] > 100 > picture[50, 50, 2]
        assert picture[35, 50, 2] > 100


def test_the_camera_keeps_lengths_and_looks_down():
    camera = Camera(azimuth=20, elevation=30)
    axes = camera.axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(axes) == pytest.approx(-1, abs=1e-6)  # y is down: the mirror image of a right-handed view
    assert camera.project(np.array([0.0, 1.0, 0.0]))[1] < 0  # up is up the page
    assert camera.project(np.array([0.0, 1.0, 0.0]))[2] > 0  # and nearer, seen from above


def test_wrapping_keeps_to_the_width_and_says_what_it_cut():
    paper = Paper(Image.new("RGB", (1, 1)), THEMES["light"])
    lines = paper.wrap("a person walks and " * 30, 20, 300, lines=2)
    assert len(lines) == 2
    assert lines[1].endswith("…")
    assert all(paper.length(line, 20) <= 300 for line in lines)
    assert paper.wrap("short", 20, 300, lines=2) == ["short"]


def test_control_characters_become_spaces():
    assert one_line(" a\tb\r\nc\x00d\u2028e ") == "a b c d e"


@pytest.mark.parametrize(
    ("text", "shown"),
    [("vorwärts, s’il vous plaît", "vorwarts, s’il vous plait"), ("Straße — 2 × Ågård", "Strasse - 2 x Agard")],
)
def test_letters_with_accents_are_drawn_without_them(text: str, shown: str) -> None:
    def line(of: str) -> NDArray[np.uint8]:
        paper = Paper(Image.new("RGB", (400, 40), (255, 255, 255)), THEMES["light"])
        paper.text((0, 0), of, 20, (0, 0, 0))
        return np.asarray(paper.image)

    assert (line(text) == line(shown)).all(), "no boxes for letters that the font does not have"
    assert Paper(Image.new("RGB", (1, 1)), THEMES["light"]).length(text, 20) == pytest.approx(
        Paper(Image.new("RGB", (1, 1)), THEMES["light"]).length(shown, 20)
    )
