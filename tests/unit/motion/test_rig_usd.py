"""Rigs of USD files without `usd-core`, and what becomes of a child process that fails; the rest is tests/clients."""

from __future__ import annotations

import hashlib
import json
import signal
import subprocess
import sys
import types

import numpy as np
import pytest

from marey.core.errors import InvalidFile, TooLarge
from marey.core.extras import MissingExtra
from marey.motion.io import rig_usd
from marey.motion.io.usd_child import UnreadableUsd, _parents  # pyright: ignore[reportPrivateUsage]
from marey.motion.retarget.reference import reference_rig
from marey.motion.rigs.read import parse_rig
from marey.motion.rotations import angle_between, to_matrix
from tests.support.usd import usda

DATA = usda().encode()


@pytest.mark.parametrize("name", ["hero.usd", "HERO.USDA", "hero.usdc"])
def test_a_usd_rig_needs_its_extra(name, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(MissingExtra, match="'usd'"):
        parse_rig(DATA, name)


@pytest.mark.parametrize(
    ("code", "kind", "message"),
    [
        (-signal.SIGXCPU, TooLarge, "takes more than 10 s to read"),
        (-signal.SIGABRT, InvalidFile, "broken, or takes too much memory"),
        (-signal.SIGSEGV, InvalidFile, "broken, or takes too much memory"),
        (1, RuntimeError, "failed on hero.usd: oh"),
    ],
)
def test_a_child_that_fails(code, kind, message, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", types.ModuleType("pxr"))
    monkeypatch.setattr(rig_usd.subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], code, b"", b"oh"))
    with pytest.raises(kind, match=message) as failed:
        parse_rig(DATA, "hero.usd")
    assert "hero.usd" in str(failed.value)


def test_a_child_that_hangs(monkeypatch):
    def hang(command, **options):
        raise subprocess.TimeoutExpired(command, options["timeout"])

    monkeypatch.setitem(sys.modules, "pxr", types.ModuleType("pxr"))
    monkeypatch.setattr(rig_usd.subprocess, "run", hang)
    with pytest.raises(TooLarge, match=r"^hero\.usd: takes more than 10 s"):
        parse_rig(DATA, "hero.usd")


def test_a_child_gets_no_settings(monkeypatch):
    seen = {}

    def run(command, **options):
        seen.update(options["env"])
        return subprocess.CompletedProcess(command, 0, b'{"error": "no", "kind": "file", "hint": null}', b"")

    monkeypatch.setitem(sys.modules, "pxr", types.ModuleType("pxr"))
    monkeypatch.setattr(rig_usd.subprocess, "run", run)
    monkeypatch.setenv("MAREY_MASTER_KEY", "secret")
    monkeypatch.setenv("PXR_PLUGINPATH_NAME", "/plugins")
    with pytest.raises(InvalidFile, match=r"^hero\.usd: no"):
        parse_rig(DATA, "hero.usd")
    assert seen
    assert not [name for name in seen if name.startswith(("MAREY_", "PXR_"))]


def answer_of(monkeypatch, **changes) -> None:
    """Let the child find a reference skeleton."""
    rig = reference_rig("mixamo")
    matrices = np.tile(np.eye(4), (len(rig), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = to_matrix(rig.orientations), rig.positions / 0.01
    found = {
        "names": rig.joint_names,
        "parents": rig.parents,
        "matrices": [matrix.T.reshape(-1).tolist() for matrix in matrices],  # rows are the axes
        "unit": 0.01,
        "up": "y",
        "notes": ["two skeletons"],
    }
    output = json.dumps(found | changes).encode()
    monkeypatch.setitem(sys.modules, "pxr", types.ModuleType("pxr"))
    monkeypatch.setattr(rig_usd.subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], 0, output, b""))


def test_a_skeleton_that_the_child_finds_is_a_rig(monkeypatch):
    answer_of(monkeypatch)
    rig, wanted = parse_rig(DATA, "folder/hero.usd"), reference_rig("mixamo")
    assert (rig.name, rig.unit, rig.up, rig.source, rig.sha256) == (
        "hero.usd", 0.01, "y", "usd", hashlib.sha256(DATA).hexdigest(),
    )  # fmt: skip
    assert "two skeletons" in rig.notes
    assert rig.joint_names == wanted.joint_names
    np.testing.assert_allclose(rig.positions, wanted.positions, atol=1e-6)
    assert angle_between(rig.orientations, wanted.orientations).max() < 1e-5


@pytest.mark.parametrize("changes", [{"unit": 1e-7}, {"unit": 1e7}, {"up": "x"}, {"unit": 0}])
def test_a_stage_of_a_unit_or_axis_that_no_rig_has_is_refused(changes, monkeypatch):
    answer_of(monkeypatch, **changes)
    with pytest.raises(InvalidFile, match=r"^hero\.usd: its unit of"):
        parse_rig(DATA, "hero.usd")


def test_joints_hang_on_the_nearest_joint_above():
    assert _parents(["Hips", "Hips/Spine", "Hips/Over/Leg", "Hips/Over/Leg/Foot", "Prop"]) == [-1, 0, 0, 2, -1]
    for paths, message in ((["Hips", "Hips"], "one path"), (["Hips/Leg", "Hips"], "stands before its parent")):
        with pytest.raises(UnreadableUsd, match=message):
            _parents(paths)
