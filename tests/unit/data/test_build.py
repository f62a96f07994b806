"""From a pack to a prepared folder, on synthetic bodies."""

from __future__ import annotations

import hashlib
import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from marey.checks.judge import Expectation, judge
from marey.checks.rates import LabelledClip
from marey.core.errors import Conflict, InvalidFile, NotFound
from marey.core.sides import swap_sides
from marey.data import compose
from marey.data.build import LAYOUT, build, windows
from marey.data.compose import Counts
from marey.data.dataset import known_set
from marey.data.inspect import summarize
from marey.data.licences import Terms
from marey.data.pack import JointsPack, PackClip
from marey.data.prepared import PreparedData
from marey.data.retime import held_longer
from marey.data.sampling import ACT_WEIGHT, SEQUENCE_SHARE, sampling_weights
from marey.motion.rotations import about, rotate
from tests.support.bodies import Body, bower, raiser, runner, steady, walker, waver
from tests.support.walker import walker as drawn_walk

MOTIONS = {
    "2/walk": lambda k: walker(3.0 + 0.5 * k),
    "2/run": lambda k: runner(2.5 + 0.5 * k),
    "1/walk-back": lambda k: Body(3.5 + 0.5 * k, speed=steady(-0.8)).joints(),
    "2/walk-turn-left": lambda k: walker(4.0 + 0.5 * k, turn=85.0 + 4 * k),
    "2/wave-left-hand": lambda k: waver("left", 3.0 + 0.5 * k),
    "2/wave-right-hand": lambda k: waver("right", 3.0 + 0.5 * k),
    "2/raise-up-both-hands": lambda k: raiser("both", 2.5 + 0.5 * k),
    "1/bow": lambda k: bower(2.5 + 0.5 * k),
}
HELD_OUT = ("2/walk-turn-right", "exhausted")


def synthetic_pack() -> JointsPack:
    clips = []
    for content, make in MOTIONS.items():
        for k, (style, split) in enumerate([("normal", "train"), ("happy", "train"), ("normal", "test")]):
            clips.append((PackClip(f"{content[2:]}-{k}", "bandai-namco", content, style, split, 0, 0), make(k)))
    for split, content, turn in (("compositional", HELD_OUT[0], -90.0), ("train", "2/walk-turn-left", 90.0)):
        name = f"{content[2:]}-{HELD_OUT[1]}"
        clips.append((PackClip(name, "bandai-namco", content, HELD_OUT[1], split, 0, 0), walker(5.0, turn=turn)))
    clips.append((PackClip("long", "bandai-namco", "2/walk", "normal", "train", 0, 0), walker(25.0)))
    clips.append((PackClip("wrong", "bandai-namco", "2/wave-left-hand", "normal", "train", 0, 0), walker()))
    clips.append((PackClip("short", "bandai-namco", "2/walk", "normal", "train", 0, 0), walker(0.8)))
    terms = [known_set("bandai-namco").terms]
    return JointsPack.of([(clip, joints.astype(np.float32)) for clip, joints in clips], terms)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    counts = dict(compose.COUNTS)
    compose.COUNTS.clear()
    compose.COUNTS["train"] = Counts(pairs=12, triples=2, retimed=16, long_turns=4, brief_waves=4)
    compose.COUNTS["test"] = Counts(pairs=3, triples=0, retimed=0)
    out = tmp_path_factory.mktemp("prepared")
    try:
        for name in ("a", "b"):
            build([synthetic_pack()], out / name)
    finally:
        compose.COUNTS.clear()
        compose.COUNTS.update(counts)
    return out


@pytest.fixture(scope="module")
def data(folder) -> PreparedData:
    return PreparedData.open(folder / "a")


def test_the_same_pack_gives_the_same_bytes(folder):
    for path in (folder / "a").iterdir():
        assert path.read_bytes() == (folder / "b" / path.name).read_bytes(), path.name


def test_features_of_every_clip_decode_to_its_joints(data):
    for clip in data.clips:
        error = np.abs(data.layout.decode(data.features(clip)) - data.joints(clip)[:-1])
        assert error.max() < 1e-3, clip.id
    assert np.isfinite(data.all_features).all()


def test_each_clip_has_its_mirror_image_with_sides_exchanged(data):
    by_id = {clip.id: clip for clip in data.clips}
    left, mirrored = by_id["wave-left-hand-0"], by_id["Mwave-left-hand-0"]
    assert (left.sides, mirrored.sides) == (("left",), ("right",))
    assert (mirrored.content, mirrored.split, mirrored.mirrored) == ("2/wave-right-hand", "train", True)
    assert "right" in " ".join(mirrored.captions).lower()
    flipped = LAYOUT.mirror_joints(data.joints(left))
    np.testing.assert_allclose(data.joints(mirrored), flipped, atol=2e-3)


def test_a_held_out_pair_is_shown_by_the_compositional_split_alone(data):
    for clip in data.clips:
        if (clip.content, clip.style) == HELD_OUT:
            assert clip.split == "compositional"
            assert not clip.spliced
    assert "its mirror image shows a held-out pair" in data.manifest.left_out["Mwalk-turn-left-exhausted"]


def test_sequences_are_made_of_clips_of_their_own_split(data):
    split = {clip.id: clip.split for clip in data.clips}
    made = [clip for clip in data.clips if clip.spliced]
    assert {clip.split for clip in made} == {"train", "test"}
    assert all(split[part] == clip.split for clip in made for part in clip.spliced)


def test_sequences_show_their_acts_in_order(data):
    made = [clip for clip in data.clips if len(clip.acts) == 2]
    verdicts = []
    for clip in made:
        expected = LabelledClip(clip.id, clip.acts, clip.sides, lambda c=clip: data.joints(c)).expected()
        assert expected is not None
        verdicts.append(judge(data.joints(clip), 20.0, expected).passed)
    assert len(made) == 12 + 3 + 4
    assert np.mean(verdicts) > 0.8


def test_a_turn_lies_somewhere_in_a_longer_walk(data):
    made = [clip for clip in data.clips if clip.id.startswith("RT-")]
    assert len(made) == 4
    for clip in made:
        assert (clip.acts, len(clip.spliced)) == (("turn",), 2)
        assert clip.length >= 120
        assert judge(data.joints(clip), 20.0, [Expectation("turn", clip.sides[0])]).passed
        assert 55 <= abs(clip.measured.turn) <= 130


def test_waves_are_cut_short_so_that_another_act_fits_beside_them(data):
    made = [clip for clip in data.clips if clip.id.startswith("SW-")]
    assert len(made) == 4
    for clip in made:
        edges = [0, *clip.seams, clip.length]
        waved = [b - a for act, a, b in zip(clip.acts, edges, edges[1:], strict=False) if act == "wave"]
        assert waved
        assert min(waved) <= 100


def test_sequences_say_where_each_act_begins_and_each_act_alone(data):
    for clip in data.clips:
        several = len(clip.acts) > 1
        assert len(clip.seams) == (len(clip.acts) - 1 if several else 0)
        assert len(clip.act_captions) == (len(clip.acts) if several else 0)
        edges = [0, *clip.seams, clip.length]
        assert all(b - a >= 15 for a, b in itertools.pairwise(edges))
        assert not set(clip.act_captions) & set(clip.captions)


def test_a_hand_is_held_longer_without_a_jump_and_unchanged_around():
    joints = raiser("left", 4.0)
    longer = held_longer(joints, 25, 55, 60)
    assert longer.shape == (len(joints) + 60, 22, 3)
    assert np.array_equal(longer[:25], joints[:25])
    assert np.array_equal(longer[-(len(joints) - 56) :], joints[56:])
    steps = np.linalg.norm(np.diff(longer, axis=0), axis=-1).max()
    assert steps <= np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() + 1e-9


def test_retimed_clips_reach_lengths_that_were_not_captured(data):
    retimed = [clip for clip in data.clips if clip.spliced and len(clip.acts) == 1]
    assert len(retimed) == 16 + 4
    assert max(clip.length for clip in retimed) > 150
    assert all(20 <= clip.length <= 196 for clip in data.clips)


def test_no_foot_or_hand_jumps_in_a_composed_clip(data):
    for clip in (c for c in data.clips if c.spliced):
        step = np.linalg.norm(np.diff(data.joints(clip), axis=0), axis=-1)
        assert step.max() < 0.55, clip.id  # 11 m/s: a running foot of these bodies has 9


def test_what_is_left_out_is_told_with_its_reason(data):
    left_out = data.manifest.left_out
    assert left_out["wrong"] == "label and motion contradict each other"
    assert left_out["short"] == "shorter than a second"
    assert not {"wrong", "short"} & {clip.id for clip in data.clips}


def test_long_clips_become_windows_that_cover_them(data):
    pieces = [clip for clip in data.clips if clip.id.startswith("long@")]
    assert len(pieces) == 3
    assert sum(clip.length + 1 for clip in pieces) == 500


@pytest.mark.parametrize("frames", [20, 197, 198, 255, 257, 394, 1267])
def test_windows_never_pass_the_limit(frames):
    found = windows(frames)
    assert all(0 <= w.start < w.stop <= frames and w.stop - w.start <= 197 for w in found)
    if frames > 256:
        assert [w.stop for w in found[:-1]] == [w.start for w in found[1:]]
        assert (found[0].start, found[-1].stop) == (0, frames)


def test_statistics_are_those_of_the_training_clips_one_deviation_a_group(data):
    rows = np.concatenate([data.features(c) for c in data.split("train") if not c.spliced])
    np.testing.assert_allclose(data.mean, rows.mean(axis=0), atol=1e-4)
    for group in data.layout.slices.values():
        deviation = max(rows[:, group].astype(float).std(axis=0).mean(), 1e-4)  # these bodies keep their height
        np.testing.assert_allclose(data.std[group], deviation, rtol=1e-3)
    assert np.abs(data.normalize(rows).mean()) < 0.01


def test_weights_are_count_to_the_minus_half_by_content_and_act_and_sequences_have_their_share(data):
    clips = data.split("train")
    weights = sampling_weights(clips)
    assert weights.sum() == pytest.approx(1)
    for length, share in SEQUENCE_SHARE.items():
        assert weights[[len(clip.acts) == length for clip in clips]].sum() == pytest.approx(share)
    single = [clip for clip in clips if len(clip.acts) == 1]
    count = {c: sum(clip.content == c for clip in single) for c in ("2/walk", "2/walk-turn-right")}
    plain = weights / [ACT_WEIGHT.get(clip.acts[0], 1.0) for clip in clips]  # a turn that was cropped may be a walk
    mass = {c: plain[[clip.content == c and len(clip.acts) == 1 for clip in clips]].sum() for c in count}
    expected = (count["2/walk"] / count["2/walk-turn-right"]) ** 0.5
    assert mass["2/walk"] / mass["2/walk-turn-right"] == pytest.approx(expected)


def test_a_rare_style_is_drawn_less_than_a_frequent_one_but_each_of_its_clips_more(data):
    clips = [clip for clip in data.split("train") if clip.acts == ("walk",)]
    weights = sampling_weights(clips)
    by_style = {s: [w for w, c in zip(weights, clips, strict=True) if c.style == s] for s in ("normal", "happy")}
    few, many = sorted(by_style.values(), key=len)
    assert len(few) < len(many)
    assert sum(few) < sum(many)
    assert few[0] > many[0]


def test_the_summary_counts_what_is_there(data):
    summary = summarize(data)
    assert summary.splits == data.manifest.splits
    assert sum(summary.kinds.values()) == len(data.clips)
    assert summary.acts["wave left"]["train"] == 4  # two of the left hand, two mirrored of the right
    assert summary.examples["bow"]
    assert sum(summary.lengths["train"].values()) == summary.splits["train"]


def test_sides_of_labels_are_exchanged():
    assert swap_sides("2/walk-turn-left") == "2/walk-turn-right"
    assert swap_sides("2/raise-up-both-hands") == "2/raise-up-both-hands"


# -- reading ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def copy(folder, tmp_path) -> Path:
    out = tmp_path / "copy"
    out.mkdir()
    for path in (folder / "a").iterdir():
        (out / path.name).write_bytes(path.read_bytes())
    return out


@pytest.mark.parametrize("name", ["features.npy", "joints.npy", "clips.jsonl", "statistics.npz"])
def test_a_changed_file_is_refused_by_name(copy, name):
    path = copy / name
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)
    with pytest.raises(InvalidFile, match="has been changed") as refused:
        PreparedData.open(copy)
    assert name in str(refused.value)


def test_a_truncated_file_is_refused_even_without_hashing(copy):
    path = copy / "features.npy"
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InvalidFile, match="truncated"):
        PreparedData.open(copy, verify=False)


def test_a_missing_file_is_refused(copy):
    (copy / "roots.npy").unlink()
    with pytest.raises(InvalidFile, match="missing"):
        PreparedData.open(copy)


def test_a_manifest_of_another_format_or_with_paths_is_refused(copy):
    manifest = json.loads((copy / "manifest.json").read_text())
    (copy / "manifest.json").write_text(json.dumps({**manifest, "format": "other-9"}))
    with pytest.raises(InvalidFile, match="format 'other-9'"):
        PreparedData.open(copy)
    files = {**manifest["files"], "../outside": {"sha256": hashlib.sha256(b"").hexdigest(), "bytes": 0}}
    (copy / "manifest.json").write_text(json.dumps({**manifest, "files": files}))
    with pytest.raises(InvalidFile, match="outside its folder"):
        PreparedData.open(copy)


def test_no_folder_is_not_found_with_the_command_that_makes_one(tmp_path):
    with pytest.raises(NotFound, match="marey data prepare"):
        PreparedData.open(tmp_path)


def test_an_unknown_split_is_not_found(data):
    with pytest.raises(NotFound, match="no split 'dev'"):
        data.split("dev")


def test_a_folder_with_something_in_it_is_not_written_to(copy):
    before = sorted(p.name for p in copy.iterdir())
    with pytest.raises(Conflict, match="not empty"):
        build([synthetic_pack()], copy)
    assert sorted(p.name for p in copy.iterdir()) == before


@pytest.mark.usefixtures("few_gestures")
def test_clips_with_nothing_to_compose_are_prepared_as_they_are(tmp_path):
    clip = PackClip("stroll", "cmu", "walk", "", "train", 0, 0)
    terms = [known_set("cmu").terms]
    build([JointsPack.of([(clip, walker(4.0).astype(np.float32))], terms)], tmp_path / "out")
    assert {c.dataset for c in PreparedData.open(tmp_path / "out").clips} == {"cmu"}


@pytest.mark.usefixtures("few_gestures")
def test_gestures_are_made_on_the_clips_of_the_training_split(tmp_path):
    idle = Body(4.0, speed=steady(0.0)).joints().astype(np.float32)
    clips = [(PackClip(split, "cmu", "idle", "", split, 0, 0, source=split), idle) for split in ("train", "test")]
    build([JointsPack.of(clips, [known_set("cmu").terms])], tmp_path / "out")
    made = {clip.id: clip.split for clip in PreparedData.open(tmp_path / "out").clips if not clip.spliced}
    of_captured = {f"{m}{split}": split for m in ("", "M") for split in ("train", "test")}
    assert made == {**of_captured, "G-wave-00000": "train", "G-wave-00001": "train"}


@pytest.mark.parametrize(("idles_of", "lengthened"), [("g1_moves", True), ("hdm05", False)])
@pytest.mark.usefixtures("few_gestures")
def test_a_short_action_without_an_idle_in_its_set_stands_between_those_of_its_tier(tmp_path, idles_of, lengthened):
    """`cmu` and `g1_moves` allow commercial use, `hdm05` wants weights to be shared alike."""
    terms = [known_set(name).terms for name in ("cmu", idles_of)]
    action = PackClip("hand", "cmu", "raise-arm", "", "train", 0, 0, source="hand")
    idle = PackClip("idle", idles_of, "idle", "", "train", 0, 0, source="idle")
    clips = [(action, raiser("left", 1.2)), (idle, Body(4.0, speed=steady(0.0)).joints())]
    build([JointsPack.of([(clip, joints.astype(np.float32)) for clip, joints in clips], terms)], tmp_path / "out")
    (made,) = (clip for clip in PreparedData.open(tmp_path / "out").clips if clip.id == "hand")
    assert (made.length > 24 + 20) == lengthened


def test_a_failed_build_leaves_no_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("marey.data.build.compose", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        build([synthetic_pack()], tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_features_do_not_know_which_way_a_clip_faces_or_where_it_is():
    here = walker(4.0, turn=60.0).astype(np.float64)
    there = rotate(about("y", np.full((len(here), 1), 2.1)), here) + np.array([3.0, 0.0, -2.0])
    encoded = [LAYOUT.encode(LAYOUT.canonicalize(joints)) for joints in (here, there)]
    assert np.abs(encoded[0] - encoded[1]).max() < 1e-6  # so turning clips about would add nothing to training


@pytest.mark.parametrize(
    ("content", "style"), [("1/walk", ""), ("1/walk", "weird"), ("2/wave-left-hand", "normal"), ("flail", "weird")]
)
def test_a_foreign_pack_with_labels_that_the_grammar_does_not_know_is_prepared(tmp_path, content, style):
    terms = Terms("foreign", "Foreign", "CC0", "someone", "", "commercial")
    clips = [PackClip(f"take{k}", "foreign", content, style, "train", 0, 0) for k in range(2)]
    pack = JointsPack.of([(clip, drawn_walk(seconds=3.0).joints.astype(np.float32)) for clip in clips], [terms])
    build([pack], tmp_path / "out")
    train = PreparedData.open(tmp_path / "out").split("train")
    assert {clip.dataset for clip in train} == {"foreign"}
    assert all(clip.captions for clip in train)
