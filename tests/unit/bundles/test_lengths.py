"""Lengths of motions: the model's, which a bundle may narrow."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from marey.bundles import Bundle, BundleWriter
from marey.bundles.limits import check_constraints, check_seconds, seconds_of, stated_seconds_of
from marey.core.errors import InvalidBundle, InvalidInput
from marey.items.constraints import read_constraints
from marey.items.item import Item
from marey.registry import get_model
from tests.support.plugins import installed, write_distribution

DANCER = """\
from marey.registry import LengthLimits, ModelSpec
SPEC = ModelSpec("dancer", "", "", handler="a:b", load="a:b", limits=LengthLimits(1.0, 8.0))
"""


def bundle(path: Path, layout: str | None = None, /, **parameters: Any) -> Bundle:
    with BundleWriter(path) as writer:
        return writer.finish(
            name=path.name, version="1", kind="generator", model="dancer", config="tiny", licence="MIT", fps=20.0,
            parameters=parameters, layout=layout,
        )  # fmt: skip


@pytest.fixture
def dancer(tmp_path: Path):
    """Install the model."""
    entries = "[marey.models]\ndancer = dancer_lengths:SPEC\n"
    with installed(write_distribution(tmp_path, "dancer", {"dancer_lengths": DANCER}, entries)):
        yield


@pytest.mark.parametrize(
    ("parameters", "seconds"),
    [
        ({}, (1.0, 8.0)),
        ({"min_frames": 40}, (2.0, 8.0)),
        ({"max_frames": 40}, (1.0, 2.0)),
        ({"min_frames": 20, "max_frames": 160}, (1.0, 8.0)),
        ({"max_frames": 40, "longest_frames": 60}, (1.0, 3.0)),
    ],
)
def test_a_bundle_narrows_its_model(
    dancer: None, tmp_path: Path, parameters: dict[str, int], seconds: tuple[float, float]
) -> None:
    found = bundle(tmp_path / "short", **parameters)
    assert seconds_of(found) == seconds
    for value in seconds:
        check_seconds(found, value)
    for value in (seconds[0] - 0.1, seconds[1] + 0.1):
        with pytest.raises(InvalidInput, match="the range of short"):
            check_seconds(found, value)


def test_words_may_state_the_length_of_a_timeline_where_the_model_makes_them(
    dancer: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = bundle(tmp_path / "short", max_frames=40)
    assert stated_seconds_of(found) == (1.0, 2.0)
    keeping = replace(get_model("dancer"), keeps_frames=True)
    monkeypatch.setattr("marey.bundles.limits.find_model", lambda name: keeping if name == "dancer" else None)
    assert stated_seconds_of(found) == (1.0, 60.0)


@pytest.mark.parametrize("parameters", [{"min_frames": 19}, {"max_frames": 161}, {"longest_frames": 161}])
def test_a_bundle_cannot_do_more_than_its_model(dancer: None, tmp_path: Path, parameters: dict[str, int]) -> None:
    with pytest.raises(InvalidBundle, match="and the model 'dancer' makes those of 1 to 8"):
        seconds_of(bundle(tmp_path / "long", **parameters))


def test_of_a_model_that_is_not_installed_the_bundle_must_say(tmp_path: Path) -> None:
    assert seconds_of(bundle(tmp_path / "known", min_frames=10, max_frames=600)) == (0.5, 30.0)
    with pytest.raises(InvalidBundle, match="no number as 'max_frames'"):
        seconds_of(bundle(tmp_path / "unknown", min_frames=10))


@pytest.mark.parametrize(
    ("rotations", "message"),
    [
        ([[1, 0, 0, 0]] * 24, "24 rotations; the model's skeleton has 22 joints"),
        ({"hips": [1, 0, 0, 0]}, "unknown joint 'hips': the pose is of another skeleton"),
    ],
)
def test_poses_of_another_skeleton_are_refused_before_the_queue(
    dancer: None, tmp_path: Path, rotations: Any, message: str
) -> None:
    found = bundle(tmp_path / "posed", "humanml3d-263")
    own = {"type": "pose_keyframe", "frame": 20, "joint_rotations": [[1, 0, 0, 0]] * 22}
    check_constraints(found, Item("a person walks", constraints=tuple(read_constraints([own]))))
    other = read_constraints([{**own, "frame": 10, "joint_rotations": rotations}])
    with pytest.raises(InvalidInput, match=message) as refused:
        check_constraints(found, Item("a person walks", constraints=(*read_constraints([own]), *other)))
    assert refused.value.where == "constraints.1.joint_rotations"
