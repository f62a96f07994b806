"""The body of a bundle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from marey.bundles import Bundle, BundleManifest
from marey.bundles.body import body_of, layout_of
from marey.core.errors import InvalidBundle
from marey.motion.body import STATURE, stature
from marey.motion.features import layout
from marey.motion.skeleton import HUMANML3D

MODELS = Path(__file__).resolve().parents[3] / "models"


def manifest(**fields):
    return BundleManifest(
        name="b", version="1", kind="generator", model="m", config="c", parameters={}, licence="MIT", parts={},
        files={}, **fields,
    )  # fmt: skip


@pytest.mark.parametrize("name", sorted(path.parent.name for path in MODELS.glob("*-starter/manifest.json")))
def test_shipped_bundles_have_the_skeleton_of_their_training_data(name):
    skeleton = layout_of(Bundle.open(MODELS / name, verify=False).manifest).skeleton
    np.testing.assert_array_equal(skeleton.offsets, HUMANML3D.offsets)


def test_offsets_of_the_layout_make_no_other_layout():
    offsets = (HUMANML3D.offsets.astype(float).round(6) + 0.0).tolist()
    assert layout_of(manifest(layout="humanml3d-263", offsets=offsets)) is layout("humanml3d-263")


def test_a_bundle_without_offsets_has_those_of_its_layout():
    assert layout_of(manifest(layout="humanml3d-263")) is layout("humanml3d-263")


def test_a_bundle_of_other_people_has_its_own_skeleton_at_the_standard_stature():
    taller = manifest(layout="humanml3d-263", offsets=(1.1 * HUMANML3D.offsets).round(6).tolist())
    np.testing.assert_allclose(layout_of(taller).skeleton.offsets, 1.1 * HUMANML3D.offsets, atol=1e-6)
    assert stature(body_of(taller).skeleton) == pytest.approx(STATURE, abs=1e-5)


@pytest.mark.parametrize("fields", [{}, {"layout": "humanml3d-263", "offsets": ((0.0, 1.0, 0.0),)}])
def test_a_bundle_without_a_usable_body_is_refused(fields):
    with pytest.raises(InvalidBundle, match=r"no layout|1 offsets"):
        body_of(manifest(**fields))
