"""The real archives, where they are at hand."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from marey.checks.quality import quality
from marey.checks.rates import LabelledClip, mean_quality, rates
from marey.data.build import parts_of
from marey.data.compose import Composer
from marey.data.pack import SPLITS, JointsPack
from marey.data.prepare import CaptureSet, pack_set
from marey.motion.kinematics import bone_lengths
from marey.motion.skeleton import HUMANML3D

DATA = Path(os.environ.get("MAREY_DATA", Path(__file__).resolve().parents[4] / "shared" / "data"))
pytestmark = [
    pytest.mark.data,
    pytest.mark.slow,
    pytest.mark.skipif(
        not (DATA / "bandai-namco.tar.xz").is_file(), reason="no capture archives: set MAREY_DATA to their folder"
    ),
]


@pytest.fixture(scope="module")
def bandai() -> JointsPack:
    return pack_set(CaptureSet.known("bandai-namco", DATA / "bandai-namco.tar.xz"))


@pytest.fixture(scope="module")
def cmu() -> JointsPack:
    return pack_set(CaptureSet.known("cmu-iclone", DATA / "cmu-iclone.tar.xz"))


@pytest.fixture(scope="module")
def left_out() -> dict[str, str]:
    return {}


@pytest.fixture(scope="module")
def parts(bandai, left_out):
    return list(parts_of([bandai], left_out))


def test_every_clip_of_the_archive_is_there_in_its_split(bandai):
    splits = json.loads((DATA / "bandai-namco-splits.json").read_text())
    published = {name: split for split in SPLITS for name in splits[split]}
    assert {clip.id: clip.split for clip in bandai.clips} == published
    assert len(bandai.clips) == 3076
    seconds = sum(clip.frames for clip in bandai.clips) / 20
    assert seconds == pytest.approx(416_845 / 30, rel=0.01)


@pytest.mark.parametrize("source", ["bandai", "cmu"])
def test_all_bodies_have_one_size_and_stand_on_the_floor(source, request):
    pack = request.getfixturevalue(source)
    lengths = np.linalg.norm(HUMANML3D.offsets[1:], axis=1)
    lowest = []
    for clip in pack.clips[::5]:
        joints = pack.joints(clip)
        assert np.abs(bone_lengths(joints, HUMANML3D)[:, 1:] - lengths).max() < 1e-3, clip.id
        lowest.append(joints[..., 1].min())
    assert np.abs(np.median(lowest)) < 0.005


def test_few_clips_contradict_their_label(parts, left_out):
    wrong = [name for name, why in left_out.items() if why.startswith("label and motion")]
    assert len(wrong) < 30
    assert len(parts) > 6000


def test_the_checker_passes_real_test_clips_and_refuses_other_acts(parts):
    test = [p for p in parts if p.source.split == "test" and not p.mirrored]
    found = rates([LabelledClip(p.id, (p.facts.action,), (p.facts.side,), lambda p=p: p.joints) for p in test], 20.0)
    assert found.overall.share >= 0.97, found.failures
    for name, rate in found.own.items():
        assert rate.share >= 0.9, name
    # a walk on a slant is a walk; a wave from the wrist is a raised hand to joints that end there
    assert max(rate.share for rate in found.wrong.values()) < 0.05


def test_sequences_are_in_order_and_no_rougher_than_their_parts(parts):
    composer = Composer([p for p in parts if p.source.split == "test"])
    made = [c for k in range(60) if (c := composer.sequence(f"test-{k}", 2)) is not None]
    assert len(made) > 30
    clips = [
        LabelledClip(c.name, tuple(f.action for f in c.facts), tuple(f.side for f in c.facts), lambda c=c: c.joints)
        for c in made
    ]
    found = rates(clips, 20.0)
    assert found.overall.share >= 0.95, found.failures
    real = mean_quality(quality(p.joints, 20.0) for c in made for p in c.parts)
    assert found.quality.jerk < 1.2 * real.jerk
    assert found.quality.skate < 1.2 * real.skate
