"""Training by two processes (torchrun, gloo)."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.two_processes import check_two_processes


@pytest.mark.slow
def test_two_processes_train_every_stage_and_resume_exactly(tmp_path: Path) -> None:
    assert check_two_processes(tmp_path, "momaskpp") == {"tokenizer", "masked", "refiner", "length"}
