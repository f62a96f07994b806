"""Sets by `dataset.toml` and `index.csv`: reading, licences, splits, floor, headings."""

from __future__ import annotations

import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.data.build import LAYOUT
from marey.data.dataset import DATASET, INDEX, SETS, known_set, known_sets, read_dataset
from marey.data.floor import levelled, on_floor
from marey.data.index import parse_index, read_index
from marey.data.licences import Terms, Tier, check_mix, tier_of
from marey.data.prepare import CaptureSet, pack_set
from marey.data.splits import Sourced, held_out, splits_by_source
from marey.motion.rotations import about, rotate
from marey.motion.support import clearance
from tests.support.bodies import bandai_bvh, walker, waver

STUDIO = (SETS / "bandai-namco" / DATASET).read_text().replace('"bandai-namco"', '"studio"', 1)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "takes").mkdir()
    (tmp_path / "takes" / "a.bvh").write_bytes(bandai_bvh(walker(4.0)))
    (tmp_path / "takes" / "b.bvh").write_bytes(bandai_bvh(waver("left", 4.0)))
    (tmp_path / DATASET).write_text(STUDIO)
    (tmp_path / INDEX).write_text(
        "file,start,end,action,captions,source\n"
        "takes/a.bvh,,,walk,a person walks|someone walks,walk 1\n"
        "takes/b.bvh,30,60,wave,a person waves,wave 1\ntakes/b.bvh,0,30,none,,wave 1\n"
    )
    return tmp_path


def test_a_folder_that_describes_itself_is_read(folder: Path) -> None:
    pack = pack_set(CaptureSet.own(folder), processes=1)
    assert [clip.id for clip in pack.clips] == ["a", "b@30"]
    assert pack.clips[0].captions == (("a person walks", "someone walks"),)
    assert pack.clips[1].frames == 20  # of 30 at 30 frames a second
    assert pack.terms == (CaptureSet.own(folder).dataset.terms,)
    assert pack.left_out["b@0"] == "not to be used"


def test_a_folder_without_a_description_is_told_how_to_get_one(folder: Path) -> None:
    (folder / DATASET).unlink()
    with pytest.raises(NotFound, match=r"no dataset\.toml"):
        CaptureSet.own(folder)


def test_a_description_nested_too_deeply_is_refused(tmp_path: Path) -> None:
    (tmp_path / DATASET).write_text("a = " + "[" * 100_000)
    with pytest.raises(InvalidFile, match="is not TOML"):
        read_dataset(tmp_path / DATASET)


def test_a_file_that_the_index_lists_must_be_there(folder: Path) -> None:
    (folder / "takes" / "b.bvh").unlink()
    with pytest.raises(InvalidFile, match=r"no b\.bvh"):
        pack_set(CaptureSet.own(folder), processes=1)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("name,action\nx,walk\n", "no column `file`"),
        ("file,split\na,training\n", "line 2"),
        ("file,start,end\na,9,3\n", "ends before it starts"),
        ("file,action\na,walk,more\n", "line 2: has 3 cells, the header 2"),
        ("file,action\nb,walk\n\na\n", "line 4: has 1 cell, the header 2"),
        ('file,action\nb,walk\na,"walk\nc,run\n', "line 3: is not CSV: a quote is never closed"),
        ('file,action\na,"walk" on\n', "line 2: is not CSV"),
        ("file,action,action\na,walk,run\n", "two columns 'action'"),
        ("file;action\na;walk\n", "no column `file`\n.*separated by semicolons"),
        ("file,captions\na,a person\0walks\n", "line 2: `captions` holds a NUL"),
        ("file,captions\na,a \x1b[31mperson\n", "line 2: `captions` holds the control character"),
        ("file,error_cm\na,nan\n", "error_cm: is not a finite number"),
        ("file,id\na,x\nb,x\n", "two clips"),
    ],
)
def test_a_broken_index_is_refused_with_its_line(text: str, says: str) -> None:
    with pytest.raises(InvalidFile, match=says):
        parse_index(text, {}, "index.csv")


def test_columns_are_made_of_those_of_another_header() -> None:
    (row,) = parse_index("clip,actor,class\nx,mm,squat\n", {"file": "{clip}", "source": "{actor} {class}"}, "i")
    assert (row.file, row.source) == ("x", "mm squat")
    with pytest.raises(InvalidFile, match="no column 'who'"):
        parse_index("clip\nx\n", {"file": "{clip}", "source": "{who}"}, "i")
    for template, says in (
        ("{clip:>999999999999}", "more than names"),
        ("{clip!r}", "more than names"),
        ("{clip", "cannot be read"),
    ):
        with pytest.raises(InvalidFile, match=says):
            parse_index("clip\nx\n", {"file": template}, "i")


def test_blank_rows_of_an_index_are_left_out() -> None:
    rows = parse_index('file,captions,,\n,,,\n\na,"one\ntwo",,\n,,,\n', {}, "i")
    assert [(row.file, row.captions) for row in rows] == [("a", ("one\ntwo",))]


@pytest.mark.parametrize("name", known_sets())
def test_known_sets_have_terms_rigs_and_a_readable_index(name: str) -> None:
    dataset = known_set(name)
    assert dataset.name == name
    assert dataset.credit
    assert tier_of(dataset.licence) == dataset.tier
    if (SETS / name / INDEX).is_file():
        assert read_index(SETS / name / INDEX, dataset.model_copy(update={"columns": {}}))


def terms(tier: Tier) -> Terms:
    return Terms(tier, tier, "x", "y", "", tier)


def test_sharealike_and_non_commercial_are_never_mixed() -> None:
    assert check_mix([terms("commercial"), terms("sharealike")]) == "sharealike"
    assert check_mix([terms("commercial"), terms("non-commercial")]) == "non-commercial"
    with pytest.raises(InvalidInput, match="no weights may be trained on both"):
        check_mix([terms("sharealike"), terms("commercial"), terms("non-commercial")])


@given(st.lists(st.tuples(st.integers(0, 40), st.sampled_from("abcde"), st.booleans()), min_size=1, max_size=80))
@settings(max_examples=50)
def test_splits_hold_out_what_they_promise_and_do_not_change_with_what_is_added(rows) -> None:
    clips = [Sourced(f"{'sa' if sa else 'c'}{n}", (a,), "sharealike" if sa else "commercial") for n, a, sa in rows]
    split = splits_by_source(clips)
    assert split.keys() == {clip.source for clip in clips}
    own = [clip for clip in clips if clip.tier == "commercial"]
    assert all(split[source] == name for source, name in splits_by_source(own).items())
    for action in {clip.actions[0] for clip in clips}:
        sources = {clip.source for clip in clips if action in clip.actions}
        if len(sources) >= 4 and all(c.actions == (action,) for c in clips if c.source in sources):
            assert sum(split[s] == "test" for s in sources) >= held_out(len(sources))[0]


@pytest.mark.parametrize(("sources", "held"), [(3, (0, 0)), (4, (1, 0)), (8, (2, 0)), (12, (2, 1)), (50, (6, 1))])
def test_as_many_sources_are_held_out_as_the_rule_says(sources: int, held: tuple[int, int]) -> None:
    assert held_out(sources) == held


def turned(joints, axis: str, degrees):
    """The body turned about an axis through its pelvis, degrees (T,)."""
    pelvis = joints[:, :1]
    return rotate(about(axis, np.radians(degrees))[:, None], joints - pelvis) + pelvis


@pytest.mark.parametrize(("axis", "degrees"), [("Z", 360), ("X", -360), ("X", -90), ("Z", 90)])
def test_headings_of_cartwheels_flips_and_lying_bodies_stay_calm_and_decode(axis: str, degrees: float) -> None:
    joints = waver("left", 4.0)
    moving = turned(joints, axis, degrees * np.clip((np.arange(len(joints)) - 20) / 30, 0, 1))
    features = LAYOUT.encode(moving)
    assert np.abs(features[:, 0]).max() < 0.05  # half a radian a second
    np.testing.assert_allclose(LAYOUT.decode(features), LAYOUT.canonicalize(moving)[:-1], atol=1e-4)


@given(st.floats(-1, 1), st.sampled_from([("X", -90.0), ("X", 90.0), ("Z", 90.0), ("X", 180.0), ("Y", 45.0)]))
@settings(max_examples=25, deadline=None)
def test_whatever_supports_the_body_lies_on_the_floor(lift: float, pose) -> None:
    axis, degrees = pose
    joints = turned(waver("left", 2.0), axis, np.full(40, degrees)) + np.array([0.0, lift, 0.0])
    assert abs(np.percentile(clearance(on_floor(joints, "support")), 2)) < 1e-9


def test_a_leap_that_never_lands_keeps_the_floor_of_its_file() -> None:
    joints = on_floor(walker(2.0), "support") + np.array([0.0, 0.5, 0.0])
    np.testing.assert_array_equal(on_floor(joints, "file"), joints)
    assert clearance(on_floor(joints - [0.0, 0.45, 0.0], "file")).min() < 0.01


def test_a_body_falls_to_the_floor_though_its_file_keeps_the_hips_at_one_height(folder: Path) -> None:
    joints = waver("left", 4.0)
    fallen = turned(joints, "X", -90 * np.clip((np.arange(len(joints)) - 20) / 30, 0, 1))
    for name, rise in (("a", 0.0), ("b", 0.02)):
        height = 0.9 + rise * np.sin(np.arange(len(joints)) / 5)
        moved = fallen + np.array([0.0, 1.0, 0.0]) * (height[:, None] - fallen[:, :1, 1])[..., None]
        (folder / "takes" / f"{name}.bvh").write_bytes(bandai_bvh(moved))
    (folder / DATASET).write_text(STUDIO.replace('floor = "feet"', 'floor = "support"'))
    (folder / INDEX).write_text("file,action\ntakes/a.bvh,die\ntakes/b.bvh,die\n")
    pack = pack_set(CaptureSet.own(folder), processes=1)
    kept, moving = (pack.joints(clip) for clip in pack.clips)
    assert np.abs(clearance(kept)).max() < 0.05
    assert kept[0, 0, 1] - kept[-1, 0, 1] > 0.3
    assert np.ptp(moving[:, 0, 1]) < 0.1  # a file that holds the height is believed


@pytest.mark.parametrize("slope", [(0.02, 0.0), (0.0, -0.018)])
def test_a_floor_that_clearly_tilts_is_made_level(slope: tuple[float, float]) -> None:
    walk = on_floor(walker(5.0), "support")
    turned = rotate(about("y", np.full((len(walk), 1), 0.7)), walk)
    tilted = turned.copy()
    tilted[..., 1] += turned[..., [0, 2]] @ np.array(slope)
    assert np.abs(on_floor(tilted, "feet")[..., 1] - turned[..., 1]).max() > 0.03
    assert np.abs(on_floor(tilted, "support")[..., 1] - turned[..., 1]).max() < 0.015


def test_a_level_floor_and_a_slope_that_is_walked_on_are_left_as_they_are() -> None:
    walk = walker(5.0)
    assert levelled(walk) is walk
    uphill = walk.copy()
    uphill[..., 1] += 0.1 * walk[..., 2]
    assert levelled(uphill) is uphill


def test_members_of_an_archive_that_are_no_bvh_are_counted(folder: Path) -> None:
    for name in ("a.c3d", "b.c3d", "notes.txt"):
        (folder / "takes" / name).write_bytes(b"x")
    with tarfile.open(folder / "takes.tar.xz", "w:xz") as out:
        out.add(folder / "takes")
    notes: list[str] = []
    own = CaptureSet.own(folder)
    pack_set(own, processes=1, note=notes.append)
    assert notes == []  # a folder holds its own description too
    pack_set(replace(own, path=folder / "takes.tar.xz"), processes=1, note=notes.append)
    (said,) = notes
    assert said.endswith("3 members that are not BVH files were passed over (2 .c3d, 1 .txt).")
