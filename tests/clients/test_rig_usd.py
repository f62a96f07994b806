"""Rigs of USD files: read where `usd-core` puts their joints; files that lead to others, or are broken, are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from marey.motion.retarget.reference import reference_rig
from tests.support.clients import python
from tests.support.usd import BIND, PLACES, REST, matrices, prim, usda
from tests.support.walker import walker

pytestmark = pytest.mark.slow

SHARED = Path(__file__).resolve().parents[2] / "shared"


def read(folder, *options):
    """Return what is read in each file of a folder, by the name without its ending."""
    seen = json.loads(python("MAREY_USD_PYTHON", "usd_rig.py", SHARED, folder, *options))
    return {Path(name).stem: each for name, each in seen.items()}


@pytest.mark.parametrize("name", ["mixamo", "ue4", "humanik"])
def test_a_written_rig_is_read_as_it_is(name, tmp_path):
    walker(seconds=0.2).save_npz(tmp_path / "a.npz")
    options = json.dumps({"rig": name})
    python("MAREY_USD_PYTHON", "usd_write.py", SHARED, tmp_path / "a.npz", tmp_path / "a.usd", options)
    (seen,), rig = read(tmp_path).values(), reference_rig(name)
    assert (tuple(seen["names"]), tuple(seen["parents"])) == (rig.joint_names, rig.parents)
    np.testing.assert_allclose(seen["places"], rig.positions, atol=1e-6)
    assert np.abs((np.array(seen["axes"]) * rig.orientations).sum(axis=1)).min() > 1 - 1e-9
    assert (seen["unit"], seen["up"], seen["notes"]) == (0.01, "y", [])
    assert seen["again"] < 1e-6
    assert seen["same"]
    python("MAREY_USD_PYTHON", "usd_check.py", tmp_path)
    rest = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["rest"]
    np.testing.assert_allclose(seen["places"], rest, atol=1e-5)


METRES = np.array(PLACES) / 100
OTHER = f"uniform matrix4d[] restTransforms = {matrices([(0, 90, 0), (5, 5, 5), (10, -9, 0), (-10, -9, 0)])}"
SCALED = (
    "double3 xformOp:scale = (0.5, 0.5, 0.5)\n    double3 xformOp:translate = (0, 0, 20)"
    '\n    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]'
)
READ = {
    "bind and rest": (usda(), METRES, []),
    "bind": (usda(BIND), METRES, []),
    "rest": (usda(REST), METRES, []),
    "another rest": (usda(BIND, OTHER), METRES, ["another pose"]),
    "placed by the stage": (usda(BIND, REST, root=SCALED), METRES / 2 + (0, 0, 0.2), []),
    "bind that does not fit": (usda("uniform matrix4d[] bindTransforms = []", REST), METRES, []),
    "names": (usda(BIND, 'uniform token[] jointNames = ["rig:Hips", "a b", "L", "R"]'), METRES, []),
    "two skeletons": (
        usda(beside=prim('def Skeleton "Small"', 'uniform token[] joints = ["Prop"]')),
        METRES,
        ["2 skeletons in the file"],
    ),
    "empty paths of assets": (usda(beside=prim('def Scope "Looks"', "asset map = @@")), METRES, []),
    "an internal inherit": (
        usda(beside=prim('class "Base"') + prim('def "Copy" ( inherits = </Character/Base> )')),
        METRES,
        [],
    ),
}  # fmt: skip


@pytest.mark.parametrize("options", [(), ("--binary",)], ids=["text", "binary"])
def test_rest_poses(options, tmp_path):
    for name, (text, _, _) in READ.items():
        (tmp_path / f"{name}.usda").write_text(text, encoding="utf-8")
    seen = read(tmp_path, *options)
    for name, (_, places, notes) in READ.items():
        each = seen[name]
        assert "error" not in each, (name, each)
        np.testing.assert_allclose(each["places"], places, atol=1e-6, err_msg=name)
        assert len(each["notes"]) == len(notes), (name, each["notes"])
        assert all(part in note for part, note in zip(notes, each["notes"], strict=True))
        assert each["again"] < 1e-6
    assert seen["names"]["names"] == ["rig:Hips", "a b", "L", "R"]
    assert seen["bind"]["names"] == ["Hips", "Spine", "LegL", "LegR"]


def test_units_and_axes_are_those_of_the_stage(tmp_path):
    text = usda().replace("metersPerUnit = 0.01", "metersPerUnit = 0.0254").replace('upAxis = "Y"', 'upAxis = "Z"')
    (tmp_path / "a.usda").write_text(text, encoding="utf-8")
    seen = read(tmp_path)["a"]
    assert (seen["unit"], seen["up"]) == (0.0254, "z")
    np.testing.assert_allclose(seen["places"], np.array(PLACES)[:, [0, 2, 1]] * (1, 1, -1) * 0.0254, atol=1e-6)
    assert seen["same"]


VARIANT = 'variantSet "look" = {\n "plain" {\n }\n "best" (\n %s\n ) {\n %s\n }\n }'
CHOSEN = 'variants = { string look = "plain" }\n prepend variantSets = "look"'
REFUSED = {
    "sublayer": (usda(stage="subLayers = [@/etc/passwd@]"), "a sublayer at /"),
    "reference": (usda(over="references = @other.usd@"), "a reference at /Character"),
    "own reference": (usda(beside=prim('def "Copy" ( references = </Character/Skeleton> )')), "a reference at"),
    "payload": (usda(over="payload = @other.usd@</A>"), "a payload at /Character"),
    "payload in a variant": (usda(over=CHOSEN, beside=VARIANT % ("payload = @o.usd@", "")), "{look=best}"),
    "texture": (usda(beside=prim('def Shader "T"', "asset inputs:file = @skin.png@")), "another file at /Character/T"),
    "textures": (usda(beside=prim('def Shader "T"', "asset[] maps = [@@, @skin.png@]")), "another file at"),
    "texture over time": (usda(beside=prim('def Shader "T"', "asset a.timeSamples = { 1: @s.png@ }")), "another file"),
    "texture in a variant": (usda(over=CHOSEN, beside=VARIANT % ("", "asset a = @s.png@")), "{look=best}.a"),
    "asset info": (usda(over="assetInfo = { dictionary d = { asset identifier = @a.usd@ } }"), "at /Character"),
    "layer data": (usda(stage="customLayerData = { asset[] a = [@b.usd@] }"), "another file at /"),
    "value clips": (usda(over='clips = { dictionary d = { string templateAssetPath = "a.#.usd" } }'), "value clips"),
    "no skeleton": ("#usda 1.0\n", "holds no skeleton"),
    "no rest pose": (usda("token visibility"), "states no rest pose"),
    "bind without size": (usda(f"uniform matrix4d[] bindTransforms = {matrices(PLACES).replace('(1, 0', '(0, 0')}"),
                          "states no rest pose"),
    "path twice": (usda(joints=("A", "A/B", "A/B", "A/C")), "two joints have one path"),
    "child first": (usda(joints=("A/B", "A", "A/C", "A/D")), "stands before its parent"),
    "too many": (usda(joints=[f"j{k}" for k in range(2001)]), "2001 joints, over the limit of 2000"),
    "unit": (usda().replace("metersPerUnit = 0.01", "metersPerUnit = 0"), "its unit of 0 metres"),
    "NaN": (usda(BIND.replace("90", "nan")), "NaN or infinite"),
    "far": (usda(f"uniform matrix4d[] bindTransforms = {matrices([(0, 1e12, 0), *PLACES[1:]])}"), "from the origin"),
    "stretched": (usda(BIND.replace("(0, 1, 0, 0)", "(0, 2, 0, 0)")), "is stretched"),
    "no USD": ("HIERARCHY", "is no USD file"),
    "cut off": (usda()[:300], "is broken at line 16"),
}  # fmt: skip


def test_files_that_lead_to_others_or_are_broken_are_refused(tmp_path):
    for name, (text, _) in REFUSED.items():
        (tmp_path / f"{name}.usda").write_text(text, encoding="utf-8")
    seen = read(tmp_path)
    for name, (_, message) in REFUSED.items():
        assert message in seen[name].get("error", "it is read"), (name, seen[name])
        assert seen[name]["kind"] in ("InvalidFile", "TooLarge")
    assert "flat file" in seen["texture"]["hint"]


def test_binary_files_that_lead_to_others_are_refused(tmp_path):
    names = ("sublayer", "reference", "payload in a variant", "texture over time", "value clips")
    for name in names:
        (tmp_path / f"{name}.usda").write_text(REFUSED[name][0], encoding="utf-8")
    seen = read(tmp_path, "--binary")
    for name in names:
        assert REFUSED[name][1] in seen[name]["error"]


@pytest.mark.parametrize("seed", range(10))
def test_a_thousand_damaged_files_are_refused_or_read(seed):
    seen = json.loads(python("MAREY_USD_PYTHON", "usd_fuzz.py", SHARED.parent, 1000, seed))
    assert sum(seen.values()) == 1000
    assert seen["refused"] > 100
