"""Write FBX files: binary, version 7.4, without Autodesk's SDK.

A file holds a skeleton of `LimbNode`s, their bind pose, one animation, and on request a skinned mesh. At rest
`Lcl Rotation` is 0: the orientation of a joint stands in `PreRotation`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.arrange import Posed, arrange
from marey.motion.export_options import PLAIN, ExportOptions, InPlace, Placement
from marey.motion.files import write_atomically
from marey.motion.io.fbx_document import TAKE, FbxDocument, ticks
from marey.motion.io.fbx_mesh import add_mesh
from marey.motion.io.fbx_nodes import FbxNode, Long, node
from marey.motion.io.fbx_templates import prop
from marey.motion.io.file_poses import FilePoses, poses_of
from marey.motion.io.mesh import Mesh
from marey.motion.rotations import Array, conjugate, continuous_euler, multiply, to_euler
from marey.motion.units import Unit, Up

ORDER = "ZYX"
"""R = Rz Ry Rx: `RotationOrder` 0, which FBX names eEulerXYZ."""
AXES = "XYZ"
LEAST = 1e-4  # metres
LINEAR = 24836
"""Flags of a key: linear interpolation, with a tangent that no program has to guess."""


def write_fbx(
    path: Path | str,
    clip: Posed,
    *,
    unit: Unit = "cm",
    up: Up = "y",
    root_bone: bool = False,
    in_place: InPlace | None = None,
    tpose_frame: bool = False,
    placement: Placement = "origin",
) -> None:
    """Write a clip as binary FBX, atomically: the skeleton in its T-pose, its bind pose, and the motion.

    Args:
        path: the file.
        clip: a MotionClip or a BvhClip.
        unit, up: of the file, which states both.
        root_bone, in_place, tpose_frame, placement: see `ExportOptions`.

    Raises:
        InvalidInput: options that contradict each other, bones that change their length, or numbers that are not
            finite.
    """
    options = ExportOptions(root_bone=root_bone, in_place=in_place, tpose_frame=tpose_frame, placement=placement)
    write_atomically(Path(path), format_fbx(clip, options, unit=unit, up=up))


def format_fbx(
    clip: Posed, options: ExportOptions = PLAIN, mesh: Mesh | None = None, *, unit: Unit = "cm", up: Up = "y"
) -> bytes:
    """Return the bytes of the FBX file; equal clips give equal bytes. See `write_fbx`.

    Args:
        mesh: a body of the clip's skeleton.
    """
    posed = arrange(clip, options)
    document = FbxDocument()
    poses = off_parent_axis(poses_of(posed, unit, up))
    models = add_motion(document, poses)
    if mesh is not None:
        add_mesh(document, mesh, poses.bind_matrices(), models, len(posed.skeleton) - len(clip.skeleton), unit, up)
    return document.encode(fps=poses.fps, frames=len(poses.rotations), unit=poses.unit, up=up)


def off_parent_axis(poses: FilePoses) -> FilePoses:
    """Return poses in which no moving joint lies exactly on the Y axis of its parent at rest.

    Blender's importers take such a joint for the end of its parent's bone, connect the two, and leave out the motion
    between them: the pelvis under a root bone would keep its height. A tenth of a millimetre is enough.
    """
    places, least = poses.places.copy(), LEAST / poses.unit
    for joint in poses.moving:
        x, y, z = places[joint]
        if poses.parents[joint] >= 0 and max(abs(x), abs(z)) < least and y > 0:
            places[joint, 2] += least
    return replace(poses, places=places)


def add_motion(document: FbxDocument, poses: FilePoses) -> list[Long]:
    """Add joints, bind pose and animation; return the identifiers of the joints.

    Raises:
        InvalidInput: numbers that are not finite.
    """
    angles = continuous_euler(to_euler(multiply(conjugate(poses.turns), poses.rotations), ORDER))[..., ::-1]
    if not (np.isfinite(angles).all() and all(np.isfinite(track).all() for track in poses.moving.values())):
        raise InvalidInput("the clip holds NaN or infinite numbers", where=poses.names[0])
    models = _add_joints(document, poses)
    _add_bind_pose(document, poses, models)
    _add_animation(document, poses, models, angles)
    return models


_OF_JOINTS = (
    prop("RotationActive", "bool", (1,)),
    prop("InheritType", "enum", (1,)),
    prop("ScalingMax", "vector", (0, 0, 0)),
    prop("DefaultAttributeIndex", "int", (0,)),
)
_UNTURNED = prop("Lcl Rotation", "Lcl Rotation", (0, 0, 0), "A+")
_OF_MODELS = node("Version", 232), node("Shading", True), node("Culling", "CullingOff")
_ATTRIBUTES = {
    "LimbNode": (node("Properties70", below=[prop("Size", "double", (1,))]), node("TypeFlags", "Skeleton")),
    "Null": (node("TypeFlags", "Null"),),
}
"""Contents of the attribute of a model by its kind."""


def _add_joints(document: FbxDocument, poses: FilePoses) -> list[Long]:
    pre = to_euler(poses.turns, ORDER)[:, ::-1]
    models: list[Long] = []
    for joint, (name, parent) in enumerate(zip(poses.names, poses.parents, strict=True)):
        limb = poses.limbs is None or poses.limbs[joint]
        kind = "LimbNode" if limb else "Null"
        scale = 1.0 if poses.scales is None else float(poses.scales[joint])
        rows = [
            prop("PreRotation", "vector", pre[joint] + 0.0),
            *_OF_JOINTS,
            prop(
                "Lcl Translation", "Lcl Translation", poses.places[joint] + 0.0, "A+" if joint in poses.moving else "A"
            ),
            _UNTURNED,
            prop("Lcl Scaling", "Lcl Scaling", (scale,) * 3),
        ]
        models.append(document.add("Model", name, "Model", kind, _model(rows)))
        document.connect(models[-1], models[parent] if parent >= 0 else 0)
        document.connect(document.add("NodeAttribute", name, "NodeAttribute", kind, _ATTRIBUTES[kind]), models[-1])
    return models


def _model(rows: list[FbxNode]) -> list[FbxNode]:
    version, *shading = _OF_MODELS
    return [version, node("Properties70", below=rows), *shading]


def _add_bind_pose(document: FbxDocument, poses: FilePoses, models: list[Long]) -> None:
    nodes = [
        node("PoseNode", below=[node("Node", model), node("Matrix", matrix.T.reshape(-1))])
        for model, matrix in zip(models, poses.bind_matrices(), strict=True)
    ]
    below = [node("Type", "BindPose"), node("Version", 100), node("NbPoseNodes", len(nodes)), *nodes]
    document.add("Pose", "bind", "Pose", "BindPose", below)


def _add_animation(document: FbxDocument, poses: FilePoses, models: list[Long], angles: Array) -> None:
    """Add one stack of one layer, with curves of rotation for all joints and of position for those that move."""
    frames = len(angles)
    times = np.array([ticks(frame, poses.fps) for frame in range(frames)], np.int64)
    span = (0, int(times[-1]))
    rows = [
        prop(f"{kind}{end}", "time", (at,))
        for kind in ("Local", "Reference")
        for end, at in zip(("Start", "Stop"), span, strict=True)
    ]
    stack = document.add("AnimationStack", TAKE, "AnimStack", "", [node("Properties70", below=rows)])
    layer = document.add("AnimationLayer", "BaseLayer", "AnimLayer", "", [])
    keys = _keys(times)
    document.connect(layer, stack)
    for joint, model in enumerate(models):
        tracks = [("R", "Lcl Rotation", angles[:, joint])]
        if joint in poses.moving:
            tracks.insert(0, ("T", "Lcl Translation", poses.moving[joint]))
        for letter, attribute, values in tracks:
            rows = [prop(f"d|{axis}", "number", (value,)) for axis, value in zip(AXES, values[0] + 0.0, strict=True)]
            curves = document.add("AnimationCurveNode", letter, "AnimCurveNode", "", [node("Properties70", below=rows)])
            document.connect(curves, layer)
            document.connect(curves, model, attribute)
            for axis, column in zip(AXES, np.ascontiguousarray(values.T), strict=True):
                curve = document.add("AnimationCurve", "", "AnimCurve", "", _curve(keys, column))
                document.connect(curve, curves, f"d|{axis}")


def _keys(times: np.ndarray) -> tuple[FbxNode, ...]:
    """Return what all curves have in common: one linear key a frame."""
    return (
        node("KeyVer", 4008),
        node("KeyTime", times),
        node("KeyAttrFlags", np.array([LINEAR], np.int32)),
        node("KeyAttrDataFloat", np.array([0, 0, 218434821, 0], np.int32).view(np.float32)),
        node("KeyAttrRefCount", np.array([len(times)], np.int32)),
    )


def _curve(keys: tuple[FbxNode, ...], values: Array) -> list[FbxNode]:
    """Return the contents of a curve."""
    version, times, *attributes = keys
    return [
        node("Default", float(values[0])),
        version,
        times,
        node("KeyValueFloat", values.astype(np.float32)),
        *attributes,
    ]
