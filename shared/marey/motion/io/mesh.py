"""A body in the rest pose, as exporters write it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """A body in the rest pose of a skeleton, each part fixed to one joint.

    Attributes:
        points: (V, 3) metres, from the joint that carries each, Y up.
        normals: (V, 3) unit vectors.
        joints: (V,) the joint that carries each point.
        triangles: (F, 3) points, counter-clockwise from outside.
        colour: of the material, linear RGB from 0 to 1.
    """

    points: NDArray[np.floating[Any]] = field(repr=False)
    normals: NDArray[np.floating[Any]] = field(repr=False)
    joints: NDArray[np.integer[Any]] = field(repr=False)
    triangles: NDArray[np.integer[Any]] = field(repr=False)
    colour: tuple[float, float, float] = (0.6, 0.58, 0.54)
