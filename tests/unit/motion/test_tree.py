"""Relations in the tree of a rig."""

from __future__ import annotations

import pytest

from marey.motion.rigs.tree import above, between, common, hangs_on

PARENTS = (-1, 0, 1, 2, 1, 4, -1)
"""0 over 1; under it 2 over 3, and 4 over 5. 6 stands alone."""


def test_what_is_above_a_joint_goes_up_to_its_root() -> None:
    assert [above(PARENTS, joint) for joint in (0, 3, 5, 6)] == [[0], [3, 2, 1, 0], [5, 4, 1, 0], [6]]


def test_a_joint_hangs_on_all_above_it_and_not_on_itself() -> None:
    assert [upper for upper in range(7) if hangs_on(PARENTS, 5, upper)] == [0, 1, 4]
    assert not any(hangs_on(PARENTS, 0, upper) for upper in range(7))


@pytest.mark.parametrize(
    ("upper", "joint", "found"), [(0, 3, [1, 2]), (1, 5, [4]), (1, 2, []), (3, 0, []), (6, 3, []), (2, 5, [])]
)
def test_between_two_joints_are_those_on_the_way_down(upper: int, joint: int, found: list[int]) -> None:
    assert between(PARENTS, upper, joint) == found


@pytest.mark.parametrize(
    ("joints", "found"), [([3, 5], 1), ([3, 2], 2), ([3], 3), ([3, 5, 0], 0), ([3, 6], -1), ([], -1)]
)
def test_joints_have_the_lowest_one_in_common_that_they_hang_on_or_are(joints: list[int], found: int) -> None:
    assert common(PARENTS, joints) == found
