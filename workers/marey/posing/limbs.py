"""Joints and bones of the body that captures are put on: the 22 joints of HumanML3D, at its proportions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.skeleton import HUMANML3D

FPS = 20.0
"""Frames a second of its motions."""
GRAVITY = 9.81
"""Metres a second, each second."""
LEG_CHAINS = ((1, 4, 7, 10), (2, 5, 8, 11))
"""Hip, knee, ankle and toe of the left leg, and of the right one."""
ARM_CHAINS = ((13, 16, 18, 20), (14, 17, 19, 21))
"""Collar, shoulder, elbow and wrist of the left arm, and of the right one."""
CARRIED = [j for j in range(22) if j not in {below for chain in LEG_CHAINS for below in chain[1:]}]
"""Joints that move with the hips, parents first: all but knees, ankles and toes."""
PARENTS = np.array([max(p, 0) for p in HUMANML3D.parents])
"""Parent of each joint (22,); the root is its own."""
BONE_LENGTHS: NDArray[np.float64] = np.linalg.norm(HUMANML3D.offsets.astype(np.float64), axis=1)
"""Metres (22,) from the parent to each joint; of the root, from the floor."""
LEVEL = np.array([1.0, 0.0, 1.0])
"""Factor of points and vectors (…, 3) that projects them onto the floor."""
