"""The mesh of an FBX file: geometry, material, skin and its clusters."""

from __future__ import annotations

import numpy as np

from marey.motion.io.fbx_document import FbxDocument
from marey.motion.io.fbx_nodes import FbxNode, Long, node
from marey.motion.io.fbx_templates import prop
from marey.motion.io.mesh import Mesh
from marey.motion.rotations import Z_TO_Y, Array, conjugate, rotate
from marey.motion.units import METRES, Unit, Up

NAME = "body"


def add_mesh(
    document: FbxDocument, mesh: Mesh, bind: Array, models: list[Long], added: int, unit: Unit, up: Up
) -> None:
    """Add a body and bind it to the joints.

    Args:
        bind: (J, 4, 4) matrices of the joints in the rest pose, in the file's unit and axes.
        models: identifiers of the joints.
        added: joints before those of the mesh: a root bone.
    """
    carriers = mesh.joints + added
    points, normals = mesh.points / METRES[unit], mesh.normals
    if up == "z":
        points, normals = rotate(conjugate(Z_TO_Y), points), rotate(conjugate(Z_TO_Y), normals)
    points = points + bind[carriers, :3, 3]
    model = document.add("Model", NAME, "Model", "Mesh", _model())
    document.connect(model, 0)
    geometry = document.add("Geometry", NAME, "Geometry", "Mesh", _geometry(points, normals, mesh))
    document.connect(geometry, model)
    document.connect(document.add("Material", NAME, "Material", "", _material(mesh)), model)
    skin = document.add("Deformer", "", "Deformer", "Skin", [node("Version", 101), node("Link_DeformAcuracy", 50.0)])
    document.connect(skin, geometry)
    for joint in sorted(set(map(int, carriers))):
        held = np.flatnonzero(carriers == joint).astype(np.int32)
        cluster = document.add("Deformer", f"{NAME}.{joint}", "SubDeformer", "Cluster", _cluster(held, bind[joint]))
        document.connect(cluster, skin)
        document.connect(models[joint], cluster)


def _model() -> list[FbxNode]:
    rows = [
        prop("RotationActive", "bool", (1,)),
        prop("InheritType", "enum", (1,)),
        prop("ScalingMax", "vector", (0, 0, 0)),
        prop("DefaultAttributeIndex", "int", (0,)),
    ]
    return [
        node("Version", 232),
        node("Properties70", below=rows),
        node("Shading", True),
        node("Culling", "CullingOff"),
    ]


def _geometry(points: Array, normals: Array, mesh: Mesh) -> list[FbxNode]:
    corners = mesh.triangles.astype(np.int32)
    polygons = corners.copy()
    polygons[:, 2] ^= -1  # the last corner of a polygon is marked by its complement
    layer_normals = [
        node("Version", 101),
        node("Name", ""),
        node("MappingInformationType", "ByPolygonVertex"),
        node("ReferenceInformationType", "Direct"),
        node("Normals", normals[corners.reshape(-1)].astype(np.float64).reshape(-1)),
    ]
    layer_materials = [
        node("Version", 101),
        node("Name", ""),
        node("MappingInformationType", "AllSame"),
        node("ReferenceInformationType", "IndexToDirect"),
        node("Materials", np.zeros(1, np.int32)),
    ]
    elements = [
        node("LayerElement", below=[node("Type", kind), node("TypedIndex", 0)])
        for kind in ("LayerElementNormal", "LayerElementMaterial")
    ]
    return [
        node("Vertices", points.astype(np.float64).reshape(-1)),
        node("PolygonVertexIndex", polygons.reshape(-1)),
        node("GeometryVersion", 124),
        node("LayerElementNormal", 0, below=layer_normals),
        node("LayerElementMaterial", 0, below=layer_materials),
        node("Layer", 0, below=[node("Version", 100), *elements]),
    ]


def _material(mesh: Mesh) -> list[FbxNode]:
    rows = [prop("DiffuseColor", "color", mesh.colour, "A"), prop("DiffuseFactor", "number", (1,))]
    below = [node("Version", 102), node("ShadingModel", "lambert"), node("MultiLayer", 0)]
    return [*below, node("Properties70", below=rows)]


def _cluster(held: np.ndarray, bind: Array) -> list[FbxNode]:
    """Return a joint's share of the skin. `TransformLink` is where the joint was, `Transform` the mesh from there."""
    return [
        node("Version", 100),
        node("UserData", "", ""),
        node("Indexes", held),
        node("Weights", np.ones(len(held))),
        node("Transform", np.linalg.inv(bind).T.reshape(-1)),
        node("TransformLink", bind.T.reshape(-1)),
    ]
