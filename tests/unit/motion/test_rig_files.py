"""Readers of rigs, the map of their joints, and what is refused."""

from __future__ import annotations

import itertools
import json
import struct
import sys
from dataclasses import replace

import numpy as np
import pytest

from marey.core.errors import InvalidFile, InvalidInput, NotFound, TooLarge
from marey.exporters import Coordinates, exporters
from marey.motion.export_options import ExportOptions
from marey.motion.io.bvh import BvhClip
from marey.motion.io.bvh_write import format_bvh
from marey.motion.io.convert import as_motion_clip
from marey.motion.io.glb_read import parse_glb
from marey.motion.io.rig_bvh import parse_bvh_rig
from marey.motion.io.rig_gltf import MAX_NODES, parse_glb_rig, parse_gltf_rig
from marey.motion.io.rig_json import format_json_rig, parse_json_rig
from marey.motion.io.rigged_bvh import format_rigged_bvh
from marey.motion.io.rigged_glb import format_rigged_glb
from marey.motion.io.rigged_glb_read import hips_motion
from marey.motion.retarget.apply import on_body
from marey.motion.retarget.load import load_body
from marey.motion.retarget.reference import REFERENCES, reference_rig
from marey.motion.retarget.source import rig_of
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.joint_map import map_joints, read_map
from marey.motion.rigs.read import read_rig
from marey.motion.rigs.rename import renamed
from marey.motion.rigs.report import describe
from marey.motion.rigs.rig import MAX_JOINTS
from marey.motion.rigs.words import read_names
from marey.motion.rotations import about, angle_between, multiply, rotate
from marey.motion.skeleton import HUMANML3D, SNAPMOGEN, skeleton_of
from marey.motion.units import FARTHEST
from tests.support.changed_rigs import Change
from tests.support.walker import walker

WALK = walker(seconds=2)


@pytest.mark.parametrize("name", REFERENCES)
def test_a_rig_read_from_its_own_glb_is_the_rig(name):
    rig = reference_rig(name)
    motion = on_body(WALK, RigBody.of(rig))
    read = parse_glb_rig(format_rigged_glb(motion), "x.glb")
    assert read.joint_names == rig.joint_names
    assert b'"scale"' not in format_rigged_glb(motion), "nodes of their full size state none"
    assert np.abs(read.positions - rig.positions).max() < 1e-6
    assert angle_between(read.orientations, rig.orientations).max() < 1e-5


def test_a_glb_on_a_rig_reads_back_with_its_joints():
    motion = on_body(WALK, load_body("ue4"))
    clip = parse_glb(format_rigged_glb(motion), "x.glb")
    places = motion.world()[1]
    for joint, name in enumerate(clip.skeleton.joint_names):
        assert np.linalg.norm(clip.joints[:, joint] - places[:, motion.rig.index(name)], axis=-1).max() < 1e-3
    assert (clip.contacts == WALK.contacts).all()
    assert clip.manifest["rig"]["name"] == "ue4"


@pytest.mark.parametrize("name", REFERENCES)
def test_a_bvh_on_a_rig_has_the_joints_of_the_glb(name):
    export = ExportOptions(rig=name)
    places = on_body(WALK, load_body(name)).world()[1]
    from marey.motion.io.bvh import parse_bvh

    data = exporters()["bvh"].write(WALK, Coordinates.of(export, "cm", "y"))
    read = parse_bvh(data, rest_frame="keep", translation="replace")
    rig = reference_rig(name)
    order = [rig.index(joint) for joint in read.skeleton.joint_names]
    assert np.linalg.norm(read.joints() - places[:, order], axis=-1).max() < 1e-3


@pytest.mark.parametrize("name", ["ue4", "humanik"])
def test_a_bvh_whose_hips_travel_under_a_still_root_reads_back(name):
    data = exporters()["bvh"].write(WALK, Coordinates.of(ExportOptions(rig=name), "cm", "y"))
    clip = as_motion_clip(exporters()["bvh"].decode(data, "x.bvh", Coordinates()))
    motion = on_body(WALK, load_body(name))
    places = motion.world()[1]
    order = [motion.rig.index(joint) for joint in clip.skeleton.joint_names]
    assert motion.rig.joint_names[motion.hips] == clip.skeleton.joint_names[0]
    assert np.linalg.norm(clip.joints - places[:, order], axis=-1).max() < 1e-3


def test_scaled_nodes_keep_their_own_units():
    nodes, size = _gltf(reference_rig("mixamo")), 0.01
    nodes[0]["children"] = [1]
    for node in nodes[1:]:
        node["translation"] = [each / size for each in node["translation"]]
    nodes[0] |= {"scale": [size] * 3, "translation": [0, 0, 0]}
    rig = parse_gltf_rig(json.dumps({"asset": {"version": "2.0"}, "nodes": nodes, "skins": [_skin(nodes)]}).encode())
    assert np.abs(rig.positions[1:] - reference_rig("mixamo").positions).max() < 1e-5
    written = parse_glb_rig(format_rigged_glb(on_body(WALK, RigBody.of(rig))), "x.glb")
    assert np.allclose(written.scales, rig.scales)


def test_a_motion_of_scaled_nodes_has_the_scales_of_all_nodes_above():
    def node(name, place, scale, *children):
        return {
            "name": name, "rotation": [0, 0, 0, 1], "translation": place, "scale": [scale] * 3, "children": children,
        }  # fmt: skip

    nodes = [
        node("Armature", [0, 0, 0], 0.01, 1),
        node("hips", [0, 90, 0], 2.0, 2),
        node("knee", [0, -20, 0], 0.5, 3),
        node("foot", [10, -30, 0], 1.0),
    ]
    motion = hips_motion(nodes, {}, {1: np.array([[0, 90, 0], [0, 90, 20]], np.float32)}, 1)
    np.testing.assert_allclose(motion.root, [[0, 0.9, 0], [0, 0.9, 0.2]], atol=1e-6)
    np.testing.assert_allclose(motion.skeleton.offsets[1:], [[0, -0.4, 0], [0.1, -0.3, 0]], atol=1e-6)


def test_json_keeps_unit_and_axis():
    rig = Change(4, "a", 4, 0.01, "z").rig()
    read = parse_json_rig(format_json_rig(rig), "x.json")
    assert (read.unit, read.up, read.joint_names) == (rig.unit, rig.up, rig.joint_names)
    assert np.abs(read.positions - rig.positions).max() < 1e-6


def test_a_bvh_rig_has_its_unit_told_by_the_body():
    data = exporters()["bvh"].write(WALK, Coordinates.of(ExportOptions(), "m", "y"))
    rig = parse_bvh_rig(data, "x.bvh")
    assert rig.unit == 1.0
    assert RigBody.of(rig).leg == pytest.approx(0.8, abs=1e-3)


def legs_up(sitting: bool) -> bytes:
    """Return a body as BVH whose legs point up where nothing is turned, as iClone writes them."""
    over = about("X", np.pi)
    offsets, rotations = HUMANML3D.offsets.copy(), np.tile([1.0, 0.0, 0.0, 0.0], (WALK.frames, 22, 1))
    for side in "LR":
        joints = [HUMANML3D.index(f"{side}_{name}") for name in ("hip", "knee", "ankle", "foot")]
        offsets[joints[1:]] = rotate(over, offsets[joints[1:]])
        rotations[:, joints[0]] = multiply(rotations[:, joints[0]], over)
        rotations[:, joints[1:]] = multiply(multiply(over, rotations[:, joints[1:]]), over)
        if sitting:
            rotations[:, joints[0]] = multiply(about("X", -1.5), rotations[:, joints[0]])
    skeleton = HUMANML3D.with_offsets(offsets)
    clip = BvhClip(skeleton, rotations, WALK.root.astype(float), None, 20.0, np.full((22, 3), np.nan))
    return format_bvh(clip).encode()


@pytest.mark.parametrize(("sitting", "pose"), [(False, "is the first frame"), (True, "is the one without rotations")])
def test_a_bvh_rest_pose_that_is_a_guess_is_noted(sitting, pose):
    rig = parse_bvh_rig(legs_up(sitting), "x.bvh")
    (note,) = [note for note in rig.notes if "rest pose" in note]
    assert pose in note
    assert "begins with a T-pose" in note
    assert RigBody.of(rig).standing is not sitting
    data = exporters()["bvh"].write(WALK, Coordinates.of(ExportOptions(), "m", "y"))
    assert not [note for note in parse_bvh_rig(data, "x.bvh").notes if "rest pose" in note]


@pytest.mark.parametrize("seed", range(6))
def test_joints_without_telling_names_are_found_by_shape(seed):
    rig = Change(seed, "a" if seed % 2 else "t", 3, 1.0, "y", twists=False).rig()
    named, blind = map_joints(rig), map_joints(replace(rig, joint_names=tuple(f"joint{j}" for j in range(len(rig)))))
    limbs = [part for part in named.parts if not part.startswith(("spine", "neck", "head", "hips"))]
    assert {part: blind.parts.get(part) for part in limbs} == {part: named.parts[part] for part in limbs}


def _grown(skeleton, chain, over, *, without=()):
    """A rig whose joints have no telling names: some left out, and on both sides a chain of more joints over one."""
    kept = [joint for joint, name in enumerate(skeleton.joint_names) if name not in without]
    parents = [kept.index(skeleton.parents[joint]) if joint else -1 for joint in kept]
    offsets = [skeleton.offsets[joint] for joint in kept]
    for side in (1.0, -1.0):
        above = kept.index(skeleton.index(over))
        for bone in chain:
            parents.append(above)
            offsets.append(np.array(bone, np.float32) * [side, 1.0, 1.0])
            above = len(parents) - 1
    names = tuple(f"joint{joint}" for joint in range(len(parents)))
    return rig_of(skeleton_of(names, tuple(parents), np.array(offsets, np.float32)))


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("over", ["spine3", "head", "pelvis"])
def test_chains_of_one_and_two_joints_are_no_limbs_however_long(joints, over):
    """Wings, ears, or the tails of a coat."""
    bare = _grown(HUMANML3D, [], "spine3")
    grown = _grown(HUMANML3D, [(0.9, 0.2, -0.1)] * joints, over)
    limbs = [part for part in map_joints(bare).parts if part.startswith(("left", "right"))]
    assert len(limbs) >= 14
    found = map_joints(grown).parts
    assert {part: found[part] for part in limbs} == {part: map_joints(bare).parts[part] for part in limbs}


def test_sides_are_not_guessed_where_the_legs_end_at_the_ankles():
    offsets = HUMANML3D.offsets.copy()
    offsets[[HUMANML3D.index(f"{side}_ankle") for side in "LR"], 2] = -0.1
    with pytest.raises(InvalidInput, match="no joint found for right upper leg, right lower leg, right foot"):
        map_joints(_grown(HUMANML3D.with_offsets(offsets), [], "spine3", without=("L_foot", "R_foot")))


def test_parts_that_a_vrm_file_leaves_out_are_found_by_their_words():
    """It has to state arms and legs, but not collar bones and toes."""
    words = {
        "hip": "thigh", "knee": "shin", "ankle": "ankle", "foot": "toes", "collar": "shoulder", "shoulder": "upperarm",
        "elbow": "forearm", "wrist": "palm",
    }  # fmt: skip
    stated = {
        "hip": "UpperLeg", "knee": "LowerLeg", "ankle": "Foot", "shoulder": "UpperArm", "elbow": "LowerArm",
        "wrist": "Hand",
    }  # fmt: skip
    names, humanoid = list[str](), {"hips": 0, "head": HUMANML3D.index("head")}
    for joint, name in enumerate(HUMANML3D.joint_names):
        side, _, part = name.rpartition("_")
        word = {"L": "left", "R": "right"}.get(side, "")
        names.append(f"body {words.get(part, part)} {word}" if side else f"body {part}")
        if side and part in stated:
            humanoid[f"{word}{stated[part]}"] = joint
    rig = load_skeleton(tuple(names), HUMANML3D)
    found = map_joints(replace(rig, extras={"humanoid": humanoid, "order": list(range(len(names)))}))
    assert dict(found.parts) == dict(map_joints(load_skeleton(HUMANML3D.joint_names, HUMANML3D)).parts)
    for part, of in (("shoulder", "words"), ("toes", "words"), ("upper_arm", "file"), ("foot", "file")):
        assert {found.how[f"{side}_{part}"] for side in ("left", "right")} == {of}


def test_effectors_and_controllers_are_no_parts():
    rig = reference_rig("humanik")
    names = tuple("LeftHandEffector" if name == "LeftArmRoll" else name for name in rig.joint_names)
    found = map_joints(replace(rig, joint_names=names))
    assert names.index("LeftHandEffector") in found.controls
    assert rig.joint_names[found.parts["left_hand"]] == "LeftHand"


def test_a_map_overrides_what_is_found():
    rig = reference_rig("mixamo")
    given = {"left_hand": "mixamorig:LeftHandMiddle1", "right_toes": None}
    found = map_joints(rig, given)
    assert rig.joint_names[found.parts["left_hand"]] == "mixamorig:LeftHandMiddle1"
    assert found.how["left_hand"] == "map"
    assert "right_toes" not in found.parts
    for wrong, message in (({"tail": "x"}, "not a part of the body"), ({"head": "nose"}, "no joint 'nose'")):
        with pytest.raises(InvalidInput, match=f"^map: .*{message}"):
            map_joints(rig, wrong)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"hips": None}, "map: no rig is without hips"),
        ({"hips": "mixamorig:Spine"}, "the legs do not hang on the hips 'mixamorig:Spine'"),
        ({"head": "mixamorig:LeftToeBase"}, "head: 'mixamorig:LeftToeBase' hangs on a leg"),
        ({"right_upper_arm": "mixamorig:RightToeBase"}, "right_upper_arm: 'mixamorig:RightToeBase' hangs on a leg"),
    ],
)
def test_a_map_that_leaves_no_body_is_refused(given, message):
    with pytest.raises(InvalidInput, match=rf"^(?=mixamo: |map: ).*({message})"):
        map_joints(reference_rig("mixamo"), given)


@pytest.mark.parametrize("skeleton", [HUMANML3D, SNAPMOGEN], ids=lambda each: each.name)
@pytest.mark.parametrize("names", ["mixamo", "ue5", "humanik", "smplx", "vrm"])
def test_renamed_joints_are_found_again(skeleton, names):
    before = map_joints(load_skeleton(skeleton.joint_names, skeleton)).parts
    after = map_joints(load_skeleton(renamed(skeleton.joint_names, skeleton.parents, names), skeleton)).parts
    assert dict(after) == dict(before)


def load_skeleton(names, skeleton):
    return replace(rig_of(skeleton), joint_names=names)


def _gltf(rig):
    """Return the nodes of a rig under a node Armature."""
    nodes = [{"name": "Armature", "children": []}]
    for joint, name in enumerate(rig.joint_names):
        w, x, y, z = rig.local_rotations[joint].tolist()
        node = {"name": name, "translation": rig.offsets[joint].tolist(), "rotation": [x, y, z, w]}
        nodes.append(
            {**node, "children": [child + 1 for child in rig.children[joint]]} if rig.children[joint] else node
        )
    nodes[0]["children"] = [1]
    return nodes


def _skin(nodes):
    return {"joints": list(range(1, len(nodes)))}


def _document(change):
    nodes = _gltf(reference_rig("mixamo"))
    document = {"asset": {"version": "2.0"}, "nodes": nodes, "skins": [_skin(nodes)]}
    change(document)
    return json.dumps(document).encode()


def _stretch(document):
    document["nodes"][5]["scale"] = [1, 2, 1]


def _mirror(document):
    document["nodes"][5]["scale"] = [-1, 1, 1]


def _circle(document):
    document["nodes"][2]["children"].append(0)


def _no_legs(document):
    hips = document["nodes"][1]
    hips["children"] = [child for child in hips["children"] if "Leg" not in document["nodes"][child]["name"]]
    document["skins"][0]["joints"] = [1, 2, 3, 4, 5]


def _giant(document):
    document["nodes"][0]["scale"] = [100, 100, 100]


def _many(document):
    document["nodes"] += [{"name": f"n{k}"} for k in range(2001)]
    document["skins"][0]["joints"] += range(len(document["nodes"]) - 2001, len(document["nodes"]))


def _outside(document):
    document["skins"][0]["joints"].append(9999)


def _far(document):
    document["nodes"][40]["translation"] = [0, 1e7, 0]


def _infinite(document):
    for node in document["nodes"]:
        node["translation"] = [1e308, 1e308, 0]


def _long_name(document):
    document["nodes"][40]["name"] = "left_" * 60


@pytest.mark.parametrize(
    ("change", "kind", "message"),
    [
        (_stretch, InvalidFile, "is stretched"),
        (_mirror, InvalidFile, "is mirrored"),
        (_circle, InvalidFile, "circle|two parents"),
        (_no_legs, InvalidInput, "no joint found for"),
        (_giant, InvalidInput, "83.1 m long: the unit of the file is wrong"),
        (_many, TooLarge, "over the limit of 2000"),
        (_outside, InvalidFile, "not there"),
        (_far, TooLarge, "1e\\+07 m from the origin"),
        (_infinite, InvalidFile, "holds NaN or infinite numbers"),
        (_long_name, TooLarge, "has 300 characters, over the limit of 256"),
        (lambda document: document.clear(), InvalidFile, "holds no skeleton"),
        (lambda document: document["nodes"][3].update(translation=["a"]), InvalidFile, "cannot be read"),
    ],
)
def test_a_bad_rig_is_refused_with_one_clear_message(change, kind, message):
    with pytest.raises(kind, match=rf"^hero\.gltf: .*({message})"):
        RigBody.of(parse_gltf_rig(_document(change), "hero.gltf"))


def _json_rig(parents):
    """A rig in JSON whose names say nothing, one joint over another."""
    joints = [
        {"name": f"j{joint}", "parent": None if parent < 0 else f"j{parent}", "position": [joint % 7, joint, 0]}
        for joint, parent in enumerate(parents)
    ]
    return json.dumps({"format": "marey-rig", "version": 1, "unit": 0.01, "up": "y", "joints": joints}).encode()


@pytest.mark.parametrize(
    "parents",
    [
        range(-1, MAX_JOINTS - 1),
        [-1] + [0] * (MAX_JOINTS - 1),
        [-1] + [0 if joint % 3 == 0 else joint for joint in range(MAX_JOINTS - 1)],
        [-1] + [max(joint // 2 * 2 - 1, 0) for joint in range(MAX_JOINTS - 1)],
    ],
    ids=["chain", "star", "short chains", "comb"],
)
def test_the_parts_of_the_largest_rigs_are_looked_for_in_few_steps(parents):
    """A chain of a hundred joints took ten seconds, one of a thousand hours. Calls are counted, not time: a million
    take a tenth of a second."""
    data, calls = _json_rig(parents), itertools.count()
    sys.setprofile(lambda *_: next(calls) and None)
    try:
        with pytest.raises(InvalidInput, match="no joint found"):
            RigBody.of(parse_json_rig(data, "x.json"))
    finally:
        sys.setprofile(None)
    assert next(calls) < 4_000_000


def test_too_many_joints_are_refused_before_they_are_read():
    with pytest.raises(TooLarge, match=r"^x\.json: 30000 joints"):
        parse_json_rig(_json_rig([-1] * 30_000), "x.json")


@pytest.mark.parametrize("prefix", ["aA1 ", "L_", "DEF-", "a."])
def test_names_with_a_prefix_many_times_are_read(prefix):
    names = [prefix * 1000 + name for name in ("Hips", "LeftLeg", "RightLeg")]
    assert len(read_names(names)) == 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda document: document.update(format="rig"), "is not a rig of version 1"),
        (lambda document: document.update(version=2), "is not a rig of version 1"),
        (lambda document: document.pop("joints"), "is not a rig: KeyError"),
        (lambda document: document.update(up="x"), "its axis y or z"),
        (lambda document: document.update(unit=1e-7), "must be metres as a number"),
        (lambda document: document.update(unit=1e7), "must be metres as a number"),
        (lambda document: document["joints"][1].update(name="j0"), "two joints have one name"),
        (lambda document: document["joints"][1].update(parent="j9"), "'j1' hangs on 'j9', which is not there"),
        (lambda document: document["joints"][1].update(rotation=[2, 0, 0, 0]), "the rotation of 'j1' is no unit"),
        (lambda document: document["joints"][1].update(rotation=[1, 0, 0]), "is not a rig: ValueError"),
    ],
)
def test_a_bad_rig_in_json_is_refused_with_one_clear_message(change, message):
    document = json.loads(_json_rig([-1, 0, 1]))
    assert len(parse_json_rig(json.dumps(document).encode(), "x.json")) == 3
    change(document)
    with pytest.raises(InvalidFile, match=rf"^x\.json: .*{message}"):
        parse_json_rig(json.dumps(document).encode(), "x.json")


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_smallest_and_the_largest_unit_are_read(unit):
    document = json.loads(_json_rig([-1, 0, 1])) | {"unit": unit}
    document["joints"] = [{**joint, "position": [0, 0, 0]} for joint in document["joints"]]
    assert parse_json_rig(json.dumps(document).encode(), "x.json").unit == unit


def test_joints_may_be_as_far_from_the_origin_as_the_limit_says():
    document = json.loads(_json_rig([-1, 0, 1])) | {"unit": 1.0}
    for far, read in ((FARTHEST, True), (-FARTHEST, True), (FARTHEST * 1.001, False)):
        document["joints"][2]["position"] = [0.0, far, 0.0]
        if read:
            assert parse_json_rig(json.dumps(document).encode(), "x.json").positions[2, 1] == far
            continue
        with pytest.raises(TooLarge, match=r"^x\.json: the node 'j2' is 1e\+06 m from the origin, over the limit"):
            parse_json_rig(json.dumps(document).encode(), "x.json")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda data: b"gltf" + data[4:], "is not a glb file"),
        (lambda data: data[:19], "is not a glb file"),
        (lambda data: data[:4] + b"\1" + data[5:], "is glTF 1; only glTF 2 is read"),
        (lambda data: data.replace(b"JSON", b"JSOM", 1), "is cut off, or its chunks are broken"),
        (lambda data: data[:-1], "is cut off, or its chunks are broken"),
    ],
)
def test_a_rig_of_a_broken_glb_is_refused(damage, message):
    data = format_rigged_glb(on_body(walker(seconds=0.1), load_body("mixamo")))
    with pytest.raises(InvalidFile, match=rf"^x\.glb: {message}"):
        parse_glb_rig(damage(data), "x.glb")


@pytest.mark.parametrize("children", [[[1, 2], [2]], [[1], [1]], [[9], []], [[-1], []]])
def test_nodes_of_two_parents_or_of_none_are_refused(children):
    document = {"nodes": [{"name": f"n{n}", "children": each} for n, each in enumerate([*children, []])]}
    with pytest.raises(InvalidFile, match=r"^x\.gltf: the node -?\d has two parents, or is not there"):
        parse_gltf_rig(json.dumps(document).encode(), "x.gltf")


def test_more_nodes_than_any_scene_has_are_refused():
    document = {"nodes": [{}] * (MAX_NODES + 1)}
    with pytest.raises(InvalidFile, match=rf"^x\.gltf: {MAX_NODES + 1} nodes, over the limit of {MAX_NODES}"):
        parse_gltf_rig(json.dumps(document).encode(), "x.gltf")


@pytest.mark.parametrize("document", [[], "hips", None, {"hips": 1}, {"hips": ["Hips"]}])
def test_a_map_that_is_none_is_refused(document):
    with pytest.raises(InvalidInput, match=r"^map\.json: is not an object of parts and joint names"):
        read_map(document, "map.json")
    assert read_map({"hips": "Hips", "left_toes": None}, "map.json") == {"hips": "Hips", "left_toes": None}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"left_hand": "mixamorig:Head", "head": "mixamorig:Head"}, "map: gives one joint to two parts"),
        (
            {"left_foot": "mixamorig:RightFoot", "right_foot": "mixamorig:LeftFoot"},
            "mixamo: the joints of the left leg do not hang on each other",
        ),
        ({"left_lower_leg": "mixamorig:LeftArm"}, "mixamo: the joints of the left leg do not hang on each other"),
    ],
)
def test_a_map_that_gives_a_joint_twice_or_crosses_the_legs_is_refused(given, message):
    with pytest.raises(InvalidInput, match=f"^{message}"):
        map_joints(reference_rig("mixamo"), given)


@pytest.mark.parametrize("format_motion", [format_rigged_bvh, format_rigged_glb])
def test_a_motion_on_a_rig_that_is_not_finite_is_not_written(format_motion):
    motion = on_body(walker(seconds=0.2), load_body("mixamo"))
    rotations = motion.rotations.copy()
    rotations[1, 3, 2] = np.nan
    with pytest.raises(InvalidInput, match=r"^mixamo: the motion holds NaN or infinite numbers"):
        format_motion(replace(motion, rotations=rotations))


def test_a_rig_that_is_not_there(tmp_path):
    with pytest.raises(InvalidInput, match=r"hero\.txt: `\.txt` is not a rig format"):
        read_rig(tmp_path / "hero.txt")
    with pytest.raises(InvalidInput, match="there is no rig 'mixano'"):
        load_body("mixano")
    with pytest.raises(NotFound):
        load_body(tmp_path / "hero.glb")
    big = tmp_path / "big.glb"
    with big.open("wb") as file:
        file.truncate(64 * 2**20 + 1)
    with pytest.raises(TooLarge, match="over the limit of 64 MiB"):
        load_body(big)


def test_a_glb_whose_chunk_claims_more_than_the_file_holds():
    data = format_rigged_glb(on_body(WALK, load_body("mixamo")))
    with pytest.raises(InvalidFile, match=r"^x\.glb: is cut off"):
        parse_glb_rig(data[:12] + struct.pack("<I", 2**31) + data[16:], "x.glb")


@pytest.mark.parametrize(
    "options", [{"mesh": True}, {"names": "vrm"}, {"rest_pose": "a"}], ids=lambda each: next(iter(each))
)
def test_options_that_contradict_a_rig(options):
    with pytest.raises(InvalidInput, match="joints and the rest pose of the rig"):
        ExportOptions(rig="mixamo", **options)
    with pytest.raises(InvalidInput, match="belongs to a rig"):
        ExportOptions(rig_map="x.json")


@pytest.mark.parametrize("word", ["l", "left", "lft"])
def test_names_tell_the_side_and_the_part(word):
    other = {"l": "r", "left": "right", "lft": "rgt"}[word]
    spellings = ("{}_hand_2", "hand.{}.002", "Bip01_{}_Hand2", "DEF-hand.2.{}")
    for spelling in spellings:
        sides = (word.capitalize(), other.capitalize()) if "Bip" in spelling else (word, other)
        names = [spelling.format(each) for each in sides]
        found = read_names(
            [*names, *(name.replace("and", "eel") for name in names), "Spine1", "Spine2", "Neck", "Head"]
        )
        assert [(each.side, each.word, each.number) for each in found[:2]] == [(0, "hand", 2), (1, "hand", 2)]
    assert [each.side for each in read_names(["Spine2", "neck"])] == [None, None]


def _with_joint(rig, name, parent, child):
    """The rig with one more joint between two, halfway."""
    names, at = list(rig.joint_names), rig.index(child)
    parents = [each + (each >= at) for each in rig.parents]
    parents[at] = at
    names.insert(at, name)
    parents.insert(at, rig.index(parent))
    middle = (rig.positions[at] + rig.positions[rig.index(parent)]) / 2
    fields = {"scales": rig.scales, "tips": rig.tips, "orientations": rig.orientations}
    return replace(
        rig,
        joint_names=tuple(names),
        parents=tuple(parents),
        positions=np.insert(rig.positions, at, middle, axis=0),
        bones=(True,) * len(names),
        **{key: np.insert(each, at, each[at], axis=0) for key, each in fields.items()},
    )


def test_a_wrist_between_the_lower_arm_and_the_hand_is_the_hand_of_the_body():
    bare = replace(reference_rig("mixamo"), notes=())
    for name, hand in (("mixamorig:LeftWrist", "mixamorig:LeftWrist"), ("mixamorig:LeftCuff", "mixamorig:LeftHand")):
        rig = _with_joint(bare, name, "mixamorig:LeftForeArm", "mixamorig:LeftHand")
        found = map_joints(rig)
        assert rig.joint_names[found.parts["left_hand"]] == hand


def test_a_report_says_what_became_of_every_joint():
    for name, root, roles in (
        ("mixamo", None, {"mixamorig:HeadTop_End": "control or end"}),
        (
            "ue4",
            "root",
            {"root": "root", "upperarm_twist_01_l": "twist of left_upper_arm", "ik_foot_l": "follows left_foot"},
        ),
    ):
        body = load_body(name)
        report = describe(body)
        assert json.loads(json.dumps(report)) == report
        assert (report["name"], report["root"], report["unit"], report["up"]) == (name, root, 0.01, body.rig.up)
        assert report["pose"] == "standing"
        assert report["leg"] == pytest.approx(body.leg, abs=1e-4)
        told = [*(part["joint"] for part in report["parts"].values()), *report["others"]]
        assert sorted(told) == sorted(body.rig.joint_names)
        assert report["parts"]["left_foot"]["joint"] == body.rig.joint_names[body.map.parts["left_foot"]]
        for joint, role in roles.items():
            assert report["others"][joint].startswith(role)


def test_bones_without_a_stated_end_are_short_and_go_on_as_the_last_one():
    motion = on_body(walker(seconds=0.1), load_body("humanik"))
    lines = format_rigged_bvh(motion).splitlines()
    ends = [at for at, line in enumerate(lines) if "End Site" in line]
    assert len(ends) > 10
    for at in ends:
        last, end = (np.array(lines[row].split()[1:], float) for row in (at - 2, at + 2))
        assert 2 < np.linalg.norm(end) < 8
        assert last @ end == pytest.approx(np.linalg.norm(last) * np.linalg.norm(end), rel=1e-4)


def test_of_two_joints_of_one_word_the_first_is_the_part():
    bare = reference_rig("mixamo")
    own = replace(bare, joint_names=tuple(name.replace("mixamorig:", "hero_") for name in bare.joint_names))
    rig = _with_joint(own, "hero_Head2", "hero_Head", "hero_HeadTop_End")
    rig = _with_joint(rig, "hero_Hips2", "hero_Hips", "hero_Spine")
    found = map_joints(rig)
    assert rig.joint_names[found.parts["head"]] == "hero_Head"
    assert rig.joint_names[found.parts["hips"]] == "hero_Hips"
