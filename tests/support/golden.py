"""Outputs of networks, compared with numbers of the published classes."""

from __future__ import annotations

from typing import Any

from torch import Tensor


def assert_golden(value: Tensor, golden: dict[str, Any]) -> None:
    """Compare shape, mean, deviation and single numbers."""
    assert list(value.shape) == golden["shape"]
    assert abs(value.double().mean().item() - golden["mean"]) < 1e-4
    assert abs(value.double().std(unbiased=False).item() - golden["std"]) < 1e-4
    for place, expected in golden["at"].items():
        assert abs(value[tuple(int(k) for k in place.strip("[]").split(","))].item() - expected) < 1e-4, place
