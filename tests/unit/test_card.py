"""Everything that may run on a GPU, on a device that is not the processor; see `tests.support.card`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CHECKS = ("devices", *(pytest.param(name, marks=pytest.mark.slow) for name in ("mogo", "hgm3", "training")))


@pytest.mark.parametrize("check", CHECKS)
def test_models_draw_and_train_on_a_device_of_their_own(check: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.support.card_checks", check, str(tmp_path)]
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"}, check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-4000:]
