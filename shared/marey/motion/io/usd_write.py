"""Write USD files with Pixar's `usd-core` (the extra `usd`): a UsdSkel skeleton and its animation, as text."""

from __future__ import annotations

import importlib
from types import SimpleNamespace
from typing import Any

import numpy as np

from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.motion.arrange import Posed, arrange
from marey.motion.export_options import PLAIN, ExportOptions
from marey.motion.io.file_poses import FilePoses, poses_of, rigged_poses
from marey.motion.io.mesh import Mesh
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import Z_TO_Y, Array, conjugate, rotate, unroll
from marey.motion.units import METRES, Unit, Up

ROOT = "/Character"
MODULES = ("Gf", "Sdf", "Tf", "Usd", "UsdGeom", "UsdSkel", "Vt")


def format_usd(
    clip: Posed, options: ExportOptions = PLAIN, mesh: Mesh | None = None, *, unit: Unit = "cm", up: Up = "y"
) -> bytes:
    """Return the bytes of a USD file (usda); equal clips give equal bytes.

    Args:
        clip: a MotionClip or a BvhClip.
        mesh: a body of the clip's skeleton.
        unit, up: of the file, which states both.

    Raises:
        InvalidInput: `usd-core` is not installed, bones change their length, or numbers are not finite.
    """
    posed = arrange(clip, options)
    poses, pxr = poses_of(posed, unit, up), load_pxr()
    stage = _stage(pxr, poses)
    if mesh is not None:
        _add_mesh(pxr, stage, poses, mesh, len(posed.skeleton) - len(clip.skeleton), unit, up)
    return _text(stage)


def format_rigged_usd(motion: RiggedMotion) -> bytes:
    """Return the bytes of a USD file of a motion on a rig, in centimetres, Y up. See `format_usd`."""
    return _text(_stage(load_pxr(), rigged_poses(motion, "usd")))


def _text(stage: Any) -> bytes:
    """Return the bytes of a stage, which has to live until then: its layer does not keep it."""
    return stage.GetRootLayer().ExportToString().encode()


def joint_paths(names: tuple[str, ...], parents: tuple[int, ...], legal: Any) -> list[str]:
    """Return the path of each joint, `hips/spine` for instance. Characters that USD does not allow become `_`, and
    siblings that are then equal get a number.

    Args:
        legal: makes a name legal: `pxr.Tf.MakeValidIdentifier`.
    """
    paths: list[str] = []
    for name, parent in zip(names, parents, strict=True):
        above = f"{paths[parent]}/" if parent >= 0 else ""
        path, number = above + legal(name), 1
        while path in paths:
            number += 1
            path = f"{above}{legal(name)}_{number}"
        paths.append(path)
    return paths


def load_pxr() -> Any:
    """Return the modules of `usd-core`.

    Raises:
        MissingExtra: it is not installed.
    """
    with extra("usd"):
        return SimpleNamespace(**{name: importlib.import_module(f"pxr.{name}") for name in MODULES})


def _stage(pxr: Any, poses: FilePoses) -> Any:
    """Return a stage with the skeleton and its animation."""
    tracks = [poses.rotations, *poses.moving.values()]
    if not all(np.isfinite(track).all() for track in tracks):
        raise InvalidInput("the clip holds NaN or infinite numbers", where=poses.names[0])
    stage = pxr.Usd.Stage.CreateInMemory("motion.usda")
    pxr.UsdGeom.SetStageUpAxis(stage, poses.up.upper())
    pxr.UsdGeom.SetStageMetersPerUnit(stage, poses.unit)
    stage.SetTimeCodesPerSecond(poses.fps)
    stage.SetFramesPerSecond(poses.fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(len(poses.rotations) - 1)
    root = pxr.UsdSkel.Root.Define(stage, ROOT)
    stage.SetDefaultPrim(root.GetPrim())
    paths = joint_paths(poses.names, poses.parents, pxr.Tf.MakeValidIdentifier)
    _add_skeleton(pxr, stage, poses, paths)
    _add_animation(pxr, stage, poses, paths)
    return stage


def _add_skeleton(pxr: Any, stage: Any, poses: FilePoses, paths: list[str]) -> None:
    skeleton = pxr.UsdSkel.Skeleton.Define(stage, f"{ROOT}/Skeleton")
    bind = poses.bind_matrices()
    local = bind.copy()
    for joint, parent in enumerate(poses.parents):
        if parent >= 0:
            local[joint] = np.linalg.inv(bind[parent]) @ bind[joint]
    skeleton.CreateJointsAttr(paths)
    skeleton.CreateJointNamesAttr(list(poses.names))
    for create, matrices in ((skeleton.CreateBindTransformsAttr, bind), (skeleton.CreateRestTransformsAttr, local)):
        create(pxr.Vt.Matrix4dArray([pxr.Gf.Matrix4d(matrix.T.tolist()) for matrix in matrices]))  # rows are the axes
    binding = pxr.UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([pxr.Sdf.Path(f"{ROOT}/Skeleton/Animation")])


def _add_animation(pxr: Any, stage: Any, poses: FilePoses, paths: list[str]) -> None:
    """Add the animation: rotations and translations of all joints in each frame, as the format asks for."""
    animation = pxr.UsdSkel.Animation.Define(stage, f"{ROOT}/Skeleton/Animation")
    animation.CreateJointsAttr(paths)
    frames, count = poses.rotations.shape[:2]
    places = np.broadcast_to(poses.places, (frames, count, 3)).copy()
    for joint, track in poses.moving.items():
        places[:, joint] = track
    scales = np.ones(count) if poses.scales is None else poses.scales
    animation.CreateScalesAttr(pxr.Vt.Vec3hArray([pxr.Gf.Vec3h(float(scale)) for scale in scales]))
    turns = unroll(poses.rotations)[..., [1, 2, 3, 0]].astype(np.float32)  # x y z w
    rotations, translations = animation.CreateRotationsAttr(), animation.CreateTranslationsAttr()
    for frame in range(frames):
        rotations.Set(pxr.Vt.QuatfArrayFromBuffer(np.ascontiguousarray(turns[frame])), frame)
        translations.Set(pxr.Vt.Vec3fArrayFromBuffer(places[frame].astype(np.float32)), frame)


def _add_mesh(pxr: Any, stage: Any, poses: FilePoses, mesh: Mesh, added: int, unit: Unit, up: Up) -> None:
    """Add a body, each point bound to one joint."""
    carriers = mesh.joints + added
    points, normals = mesh.points / METRES[unit], mesh.normals
    if up == "z":
        points, normals = rotate(conjugate(Z_TO_Y), points), rotate(conjugate(Z_TO_Y), normals)
    points = (points + poses.bind_matrices()[carriers, :3, 3]).astype(np.float32)
    body = pxr.UsdGeom.Mesh.Define(stage, f"{ROOT}/Body")
    body.CreatePointsAttr(pxr.Vt.Vec3fArrayFromBuffer(points))
    body.CreateNormalsAttr(pxr.Vt.Vec3fArrayFromBuffer(normals.astype(np.float32)))
    body.SetNormalsInterpolation("vertex")
    body.CreateFaceVertexIndicesAttr(mesh.triangles.reshape(-1).tolist())
    body.CreateFaceVertexCountsAttr([3] * len(mesh.triangles))
    body.CreateSubdivisionSchemeAttr("none")
    body.CreateExtentAttr(_extent(pxr, points))
    body.CreateDisplayColorAttr([pxr.Gf.Vec3f(*mesh.colour)])
    binding = pxr.UsdSkel.BindingAPI.Apply(body.GetPrim())
    binding.CreateSkeletonRel().SetTargets([pxr.Sdf.Path(f"{ROOT}/Skeleton")])
    binding.CreateJointIndicesPrimvar(False, 1).Set(carriers.tolist())
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * len(carriers))
    binding.CreateGeomBindTransformAttr(pxr.Gf.Matrix4d(1))


def _extent(pxr: Any, points: Array) -> list[Any]:
    return [pxr.Gf.Vec3f(*corner.tolist()) for corner in (points.min(axis=0), points.max(axis=0))]
