"""Defaults of object types that an FBX file states before its objects, as Maya and MotionBuilder write them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache

from marey.motion.io.fbx_nodes import FbxNode, Long, Property, node

TYPES = {
    "bool": ("bool", ""),
    "color": ("ColorRGB", "Color"),
    "compound": ("Compound", ""),
    "double": ("double", "Number"),
    "enum": ("enum", ""),
    "int": ("int", "Integer"),
    "number": ("Number", ""),
    "object": ("object", ""),
    "string": ("KString", ""),
    "time": ("KTime", "Time"),
    "ulonglong": ("ULongLong", ""),
    "vector": ("Vector3D", "Vector"),
}
"""Type and label of properties by a short name; other names stand for themselves."""

_AXES = ["X", "Y", "Z"]
_NODE: list[tuple[str, str, tuple[float, ...]]] = [
    ("QuaternionInterpolate", "enum", (0,)),
    *((name, "vector", (0, 0, 0)) for name in ("RotationOffset", "RotationPivot", "ScalingOffset", "ScalingPivot")),
    ("TranslationActive", "bool", (0,)),
    *((name, "vector", (0, 0, 0)) for name in ("TranslationMin", "TranslationMax")),
    *((f"Translation{end}{axis}", "bool", (0,)) for end in ("Min", "Max") for axis in _AXES),
    ("RotationOrder", "enum", (0,)),
    ("RotationSpaceForLimitOnly", "bool", (0,)),
    *((f"RotationStiffness{axis}", "double", (0,)) for axis in _AXES),
    ("AxisLen", "double", (10,)),
    *((name, "vector", (0, 0, 0)) for name in ("PreRotation", "PostRotation")),
    ("RotationActive", "bool", (0,)),
    *((name, "vector", (0, 0, 0)) for name in ("RotationMin", "RotationMax")),
    *((f"Rotation{end}{axis}", "bool", (0,)) for end in ("Min", "Max") for axis in _AXES),
    ("InheritType", "enum", (0,)),
    ("ScalingActive", "bool", (0,)),
    ("ScalingMin", "vector", (0, 0, 0)),
    ("ScalingMax", "vector", (1, 1, 1)),
    *((f"Scaling{end}{axis}", "bool", (0,)) for end in ("Min", "Max") for axis in _AXES),
    ("GeometricTranslation", "vector", (0, 0, 0)),
    ("GeometricRotation", "vector", (0, 0, 0)),
    ("GeometricScaling", "vector", (1, 1, 1)),
    *((f"{end}Damp{kind}{axis}", "double", (0,))
      for kind in ("Range", "Strength") for end in ("Min", "Max") for axis in _AXES),
    *((f"PreferedAngle{axis}", "double", (0,)) for axis in _AXES),
    ("LookAtProperty", "object", ()),
    ("UpVectorProperty", "object", ()),
    ("Show", "bool", (1,)),
    ("NegativePercentShapeSupport", "bool", (1,)),
    ("DefaultAttributeIndex", "int", (-1,)),
    ("Freeze", "bool", (0,)),
    ("LODBox", "bool", (0,)),
    ("Lcl Translation", "Lcl Translation", (0, 0, 0)),
    ("Lcl Rotation", "Lcl Rotation", (0, 0, 0)),
    ("Lcl Scaling", "Lcl Scaling", (1, 1, 1)),
    ("Visibility", "Visibility", (1,)),
    ("Visibility Inheritance", "Visibility Inheritance", (1,)),
]  # fmt: skip
_STACK = [
    ("Description", "string", ""),
    *((name, "time", (0,)) for name in ("LocalStart", "LocalStop", "ReferenceStart", "ReferenceStop")),
]
_LAYER = [
    ("Weight", "number", (100,)),
    *((name, "bool", (0,)) for name in ("Mute", "Solo", "Lock")),
    ("Color", "color", (0.8, 0.8, 0.8)),
    *((name, "enum", (0,)) for name in ("BlendMode", "RotationAccumulationMode", "ScaleAccumulationMode")),
    ("BlendModeBypass", "ulonglong", (0,)),
]
_SKELETON = [("Color", "color", (0.8, 0.8, 0.8)), ("Size", "double", (33.333333333333336,))]
_MESH = [
    ("Color", "color", (0.8, 0.8, 0.8)),
    *((name, "vector", (0, 0, 0)) for name in ("BBoxMin", "BBoxMax")),
    *((name, "bool", (on,)) for name, on in (("Primary Visibility", 1), ("Casts Shadows", 1), ("Receive Shadows", 1))),
]
_LAMBERT = [
    ("ShadingModel", "string", "Lambert"),
    ("MultiLayer", "bool", (0,)),
    ("AmbientColor", "Color", (0.2, 0.2, 0.2)),
    ("DiffuseColor", "Color", (0.8, 0.8, 0.8)),
    ("DiffuseFactor", "number", (1,)),
]
TEMPLATES: dict[str, tuple[str, Iterable[tuple[str, str, tuple[float, ...] | str]]]] = {
    "AnimationStack": ("FbxAnimStack", _STACK),
    "AnimationLayer": ("FbxAnimLayer", _LAYER),
    "NodeAttribute": ("FbxSkeleton", _SKELETON),
    "Model": ("FbxNode", _NODE),
    "Geometry": ("FbxMesh", _MESH),
    "Material": ("FbxSurfaceLambert", _LAMBERT),
}
"""Class and properties of the template of an object type."""
_WHOLE = {"bool", "enum", "int", "Visibility Inheritance"}
_LONG = {"time", "ulonglong"}
_ANIMATABLE = {"number", "Visibility", "Color"}


def prop(name: str, kind: str, values: Iterable[float] | str, flags: str | None = None) -> FbxNode:
    """Return a property `P` of an object.

    Args:
        kind: a key of `TYPES`, or a type of that name.
        values: numbers, or a text.
        flags: `A` = can be animated, `A+` = is animated, `U` = the user's; None = as usual for the kind.
    """
    label, sub = TYPES.get(kind, (kind, ""))
    if flags is None:
        flags = "A" if kind in _ANIMATABLE or kind.startswith("Lcl") else ""
    if isinstance(values, str):
        return node("P", name, label, sub, flags, values)
    number: type[Property] = Long if kind in _LONG else int if kind in _WHOLE else float
    return node("P", name, label, sub, flags, *(number(value) for value in values))


@cache
def _template(kind: str) -> FbxNode:
    name, properties = TEMPLATES[kind]
    rows = [prop(*each) for each in properties]
    return node("PropertyTemplate", name, below=[node("Properties70", below=rows)])


def definitions(counts: Mapping[str, int]) -> FbxNode:
    """Return the node `Definitions`: how many objects of each type follow, and their templates."""
    types: list[FbxNode] = [node("ObjectType", "GlobalSettings", below=[node("Count", 1)])]
    for kind, count in counts.items():
        below = [node("Count", count)]
        if kind in TEMPLATES:
            below.append(_template(kind))
        types.append(node("ObjectType", kind, below=below))
    total = 1 + sum(counts.values())
    return node("Definitions", below=[node("Version", 100), node("Count", total), *types])
