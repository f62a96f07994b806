"""The body over the floor."""

from __future__ import annotations

import numpy as np

from marey.motion.support import RADII, clearance
from tests.support.walker import walker


def test_clearance_is_that_of_the_lowest_part_in_each_frame() -> None:
    joints = np.array(walker().joints[:3], np.float64)
    joints[..., 1] += 1.0
    joints[1, 15, 1] = 0.3  # a head that hangs
    joints[2, 20, 1] = -0.1
    found = clearance(joints)
    assert found.shape == (3,)
    np.testing.assert_allclose(found[1:], [0.3 - RADII[15], -0.1 - RADII[20]])
    assert found[0] > 0.5
    np.testing.assert_allclose(clearance(joints[None]), found[None])
