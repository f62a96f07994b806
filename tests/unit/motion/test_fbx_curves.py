"""Keys of FBX curves: how each leads to the next."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from marey.core.errors import InvalidFile
from marey.motion.io.fbx_curves import LINEAR, Curve, _curve  # pyright: ignore[reportPrivateUsage]
from marey.motion.io.fbx_nodes import TICKS

CONSTANT = 2
KEYS = 4


def read(counts: list[int], flags: list[int], data: list[float], **changed: list[float]) -> Curve:
    """The curve of four keys, whose attributes are shared by so many keys each; `changed` arrays of the file."""
    arrays: dict[str, Any] = {
        "KeyTime": np.arange(KEYS) * TICKS,
        "KeyValueFloat": np.arange(KEYS, dtype=np.float32),
        "KeyAttrRefCount": np.array(counts),
        "KeyAttrFlags": np.array(flags),
        "KeyAttrDataFloat": np.array(data, np.float32),
    }
    arrays |= {name: np.array(each) for name, each in changed.items()}
    file = SimpleNamespace(
        array=lambda name, _kinds, most: arrays[name],  # pyright: ignore[reportUnknownLambdaType]
        broken=lambda message: InvalidFile(message, where="a.fbx"),  # pyright: ignore[reportUnknownLambdaType]
    )
    scene: Any = SimpleNamespace(file=file)
    node: Any = SimpleNamespace(first=lambda name: name)  # pyright: ignore[reportUnknownLambdaType]
    return _curve(scene, node)


@pytest.mark.parametrize("counts", [[1, 3], [1, 3, 0], [0, 1, 3]])
def test_attributes_are_shared_by_as_many_keys_as_their_count_says_also_by_none(counts: list[int]) -> None:
    flags = [CONSTANT if count != 3 else LINEAR for count in counts]
    slopes = [[float(count), 2.0, 7.0, 7.0] for count in counts]
    found = read(counts, flags, np.ravel(slopes).tolist())
    assert found.flags.tolist() == [CONSTANT, LINEAR, LINEAR, LINEAR]
    assert found.slopes.tolist() == [[1.0, 2.0], [3.0, 2.0], [3.0, 2.0], [3.0, 2.0]]


@pytest.mark.parametrize(
    ("counts", "flags", "numbers"), [([1, 2], 2, 8), ([-1, 5], 2, 8), ([4], 2, 4), ([4], 1, 3), ([5], 1, 4), ([], 0, 0)]
)
def test_keys_whose_attributes_contradict_each_other_are_joined_by_lines(
    counts: list[int], flags: int, numbers: int
) -> None:
    found = read(counts, [CONSTANT] * flags, [1.0] * numbers)
    assert found.flags.tolist() == [LINEAR] * KEYS
    assert not found.slopes.any()


@pytest.mark.parametrize(
    ("times", "values"),
    [
        ([], []),
        ([0, 1, 2, 3], [0, 1, 2]),
        ([0, 1, 2], [0, 1, 2, 3]),
        ([0, 1, 1, 2], [0, 1, 2, 3]),
        ([0, 2, 1, 3], [0, 1, 2, 3]),
        ([0, 1, 2, 3], [0, 1, float("nan"), 3]),
        ([0, 1, 2, 3], [0, 1, float("inf"), 3]),
        ([0], []),
    ],
)
def test_a_curve_whose_times_and_values_contradict_each_other_is_refused(times: list[int], values: list[float]) -> None:
    with pytest.raises(InvalidFile) as refused:
        read([len(times)], [LINEAR], [0.0] * 4, KeyTime=[each * TICKS for each in times], KeyValueFloat=values)
    counts = f"a curve has {len(times)} times and {len(values)} values"
    assert refused.value.message == f"{counts}, or they are not in order"
