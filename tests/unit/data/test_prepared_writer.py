"""Writing of prepared folders on a disk that takes no more."""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.data.folder import PreparedWriter
from marey.motion.features import HUMANML3D_263 as LAYOUT


def test_a_disk_that_is_full_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**16, before[1]))
    try:
        with pytest.raises(InvalidInput, match="cannot be written: File too large") as refused:
            fill(tmp_path / "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert refused.value.where == str(tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def fill(out: Path) -> None:
    joints = np.zeros((201, len(LAYOUT.skeleton), 3))
    with PreparedWriter(out, LAYOUT) as writer:
        for _ in range(20):
            writer.append(np.zeros((200, LAYOUT.dim)), joints, None)  # type: ignore[arg-type]
