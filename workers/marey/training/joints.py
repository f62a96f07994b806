"""Joints in space from HumanML3D-like features, differentiable: the torch twin of `FeatureLayout.decode`."""

from __future__ import annotations

import torch
from torch import Tensor

from marey.core.errors import InvalidInput
from marey.motion.features import HeadingLayout, layout


def unit_of(name: str) -> float:
    """Return the metres in one unit of the features of a layout whose joints these functions read.

    Raises:
        NotFound: there is no such layout.
        InvalidInput: the joints of the layout lie elsewhere.
    """
    known = layout(name)
    if not isinstance(known, HeadingLayout):
        raise InvalidInput(f"{name} does not hold joints as HumanML3D's layout does", where="layout")
    return known.unit


def heading_joints(features: Tensor, joints: int, unit: float = 1.0) -> Tensor:
    """Convert (B, T, D) to joints (B, T, J, 3) in metres over the root's ground point, in the heading frame; no
    integration. `unit` is that of the features, in metres."""
    features = features.float() * unit
    batch, frames = features.shape[:2]
    root = torch.zeros_like(features[..., :3])
    root[..., 1] = features[..., 3]
    others = features[..., 4 : 4 + 3 * (joints - 1)].view(batch, frames, joints - 1, 3)
    return torch.cat([root[:, :, None], others], 2)


def world_joints(features: Tensor, joints: int, unit: float = 1.0) -> Tensor:
    """Decode positions: (B, T, D) features in their own units to (B, T, J, 3) metres, Y up, facing +Z in frame 0.

    Columns: [0] half the yaw delta a frame, [1:3] displacement in the heading frame, [3] root height, [4:4+3(J-1)]
    the other joints relative to the root's ground point, in the heading frame (HumanML3D, Guo et al. 2022). `unit` is
    that of the features, in metres.
    """
    half = features[..., 0].float().cumsum(1)
    features = features.float() * unit
    batch, frames = features.shape[:2]
    angle = torch.cat([half.new_zeros(batch, 1), half[:, :-1]], 1)  # (B, T): sum over the frames before
    # heading frame to world: rotation about Y by -2 · angle
    cos, sin = torch.cos(2 * angle), torch.sin(2 * angle)
    step = torch.cat([features.new_zeros(batch, 1, 2), features[:, :-1, 1:3]], 1)  # (B, T, 2): x, z
    root_x = (cos * step[..., 0] - sin * step[..., 1]).cumsum(1)
    root_z = (sin * step[..., 0] + cos * step[..., 1]).cumsum(1)
    local = features[..., 4 : 4 + 3 * (joints - 1)].view(batch, frames, joints - 1, 3)
    x = cos[..., None] * local[..., 0] - sin[..., None] * local[..., 2] + root_x[..., None]
    z = sin[..., None] * local[..., 0] + cos[..., None] * local[..., 2] + root_z[..., None]
    others = torch.stack([x, local[..., 1], z], -1)  # (B, T, J - 1, 3)
    root = torch.stack([root_x, features[..., 3], root_z], -1)[:, :, None]
    return torch.cat([root, others], 2)
