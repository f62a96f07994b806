"""Everything that may run on a GPU, on a device that is not the processor; see `tests.support.card`."""

from __future__ import annotations

from pathlib import Path

import pytest

from marey.registry import model_names
from tests.support.card_runs import run_check

CHECKS = ("devices", *(pytest.param(name, marks=pytest.mark.slow) for name in (*model_names(), "training")))


@pytest.mark.parametrize("check", CHECKS)
def test_models_draw_and_train_on_a_device_of_their_own(check: str, tmp_path: Path) -> None:
    run_check("tests.support.card_checks", check, tmp_path)
