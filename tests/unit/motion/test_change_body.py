"""Finished motions on bodies of other proportions: as if they had been generated on them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.motion.body import NamedBody, standard_body
from marey.motion.change_body import change_body, load_shape
from marey.motion.clip import MotionClip
from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.motion.kinematics import bone_lengths
from marey.motion.skeleton import HUMANML3D, KIT, Skeleton
from tests.support.stepping import sliding
from tests.unit.motion.test_body_files import CHILD, SHORT_LEGS, TALL, still, write

FEATURES = HUMANML3D_263.encode(sliding(0.02, 1))
BODIES = pytest.mark.parametrize("skeleton", [CHILD, SHORT_LEGS, TALL], ids=["child", "short legs", "tall"])


def finished(clean: bool = True, **options: Any) -> MotionClip:
    manifest = {"prompt": "a person walks", "feet_cleaned": clean, "quality": {"version": 1}}
    return finish_motion(FEATURES, HUMANML3D_263, clean=clean, manifest=manifest, **options)


@BODIES
@pytest.mark.parametrize(("fps", "clean", "near"), [(20, True, 0.02), (60, True, 0.05), (20, False, 1e-6)])
def test_a_motion_is_that_which_would_have_been_generated_on_the_body(
    skeleton: Skeleton, fps: float, clean: bool, near: float
) -> None:
    body = NamedBody("other.bvh", skeleton)
    wanted = finished(clean, fps=fps, body=body)
    clip = change_body(finished(clean, fps=fps), body)
    off = np.linalg.norm(clip.joints - wanted.joints, axis=-1)
    assert (off.max() < near, off.mean() < 0.0015) == (True, True)
    assert (clip.contacts == wanted.contacts).mean() > 0.98
    np.testing.assert_array_equal(clip.offsets, skeleton.offsets)
    bones = np.linalg.norm(skeleton.offsets[1:], axis=-1)
    np.testing.assert_allclose(
        bone_lengths(clip.joints, clip.skeleton)[:, 1:], np.tile(bones, (clip.frames, 1)), atol=1e-5
    )


@BODIES
def test_feet_that_stand_stay_where_they_are(skeleton: Skeleton) -> None:
    clip = change_body(finished(), NamedBody("other.bvh", skeleton))
    toes, stands = clip.joints[:, list(skeleton.feet[1::2])], clip.contacts[:, 1::2]
    assert stands.any()
    moved = np.linalg.norm(np.diff(toes, axis=0)[..., [0, 2]], axis=-1)
    assert moved[stands[1:] & stands[:-1]].max() < 0.010


def test_the_manifest_names_the_body_and_loses_what_was_measured_on_the_other() -> None:
    body = NamedBody("child.bvh", CHILD)
    about = change_body(finished(), body).manifest
    assert about == {"prompt": "a person walks", "feet_cleaned": True, "body": body.describe()}


def test_a_motion_on_the_body_stays_as_it_is() -> None:
    clip = finished()
    assert change_body(clip, standard_body(HUMANML3D)) is clip
    assert change_body(clip, load_shape("standard")) is clip


def test_other_skeletons_are_refused() -> None:
    with pytest.raises(InvalidInput, match=r"^body: bodies fit motions on humanml3d; this one is on kit") as caught:
        change_body(still(KIT), NamedBody("child.bvh", CHILD))
    assert caught.value.argument == "body"


def test_a_file_that_changes_is_read_again(tmp_path) -> None:
    path = write(tmp_path / "body.bvh", CHILD)
    first = load_shape(path)
    assert load_shape(str(path)) is first
    path.unlink()
    still(TALL).save_npz(tmp_path / "body.npz")
    write(path, TALL)
    assert load_shape(path).sha256 == load_shape(tmp_path / "body.npz").sha256 != first.sha256
