"""A body whose arm passes through it."""

from __future__ import annotations

import numpy as np

from tests.support.walker import walker


def with_hand_in_the_trunk():
    """Return joints of a walk whose right hand passes through the belly for half a second."""
    joints = np.array(walker(seconds=3).joints, np.float64)
    belly = joints[:, [0, 3]].mean(axis=1)
    inside = np.exp(-(((np.arange(len(joints)) / 20 - 1.5) / 0.25) ** 2))[:, None]
    moved = joints.copy()
    moved[:, 21] += inside * (belly - joints[:, 21])
    forearm, upper = (np.linalg.norm(joints[0, a] - joints[0, b]) for a, b in ((19, 21), (17, 19)))
    for frame in moved:
        whole = frame[21] - frame[17]
        reach = min(np.linalg.norm(whole), 0.999 * (upper + forearm))
        way = whole / np.linalg.norm(whole)
        frame[21] = frame[17] + reach * way
        along = (reach**2 + upper**2 - forearm**2) / (2 * reach)
        aside = np.cross(way, [0, 0, 1.0])
        side = aside / np.linalg.norm(aside) * np.sqrt(max(upper**2 - along**2, 0))
        frame[19] = frame[17] + along * way + side
    return moved
