"""USD files as text, for tests of what reads them."""

from __future__ import annotations

from collections.abc import Sequence

JOINTS = ("Hips", "Hips/Spine", "Hips/LegL", "Hips/LegR")
PLACES = ((0, 90, 0), (0, 110, 0), (10, 85, 0), (-10, 85, 0))
"""Places of the joints in centimetres, in the world."""
ABOVE = (-1, 0, 0, 0)


def matrix(place: Sequence[float], scale: float = 1) -> str:
    x, y, z = place
    return f"( ({scale}, 0, 0, 0), (0, {scale}, 0, 0), (0, 0, {scale}, 0), ({x}, {y}, {z}, 1) )"


def matrices(places: Sequence[Sequence[float]]) -> str:
    return "[" + ", ".join(map(matrix, places)) + "]"


BIND = f"uniform matrix4d[] bindTransforms = {matrices(PLACES)}"
LOCAL = [
    place if above < 0 else tuple(a - b for a, b in zip(place, PLACES[above], strict=True))
    for place, above in zip(PLACES, ABOVE, strict=True)
]
REST = f"uniform matrix4d[] restTransforms = {matrices(LOCAL)}"


def prim(head: str, *attributes: str) -> str:
    lines = "\n        ".join(attributes)
    return f"{head}\n    {{\n        {lines}\n    }}\n"


def usda(
    *attributes: str, stage: str = "", over: str = "", root: str = "", beside: str = "", joints: Sequence[str] = JOINTS
) -> str:
    """A stage with a skeleton.

    Args:
        attributes: of the skeleton.
        stage: metadata of the stage beside unit and axis.
        over: metadata of the prim over the skeleton.
        root: attributes of that prim.
        beside: prims beside the skeleton.
        joints: their paths.
    """
    names = ", ".join(f'"{joint}"' for joint in joints)
    lines = "\n        ".join(attributes or (BIND, REST))
    return f"""#usda 1.0
(
    defaultPrim = "Character"
    metersPerUnit = 0.01
    upAxis = "Y"
    {stage}
)
def SkelRoot "Character" (
    {over}
)
{{
    {root}
    def Skeleton "Skeleton"
    {{
        uniform token[] joints = [{names}]
        {lines}
    }}
    {beside}
}}
"""
