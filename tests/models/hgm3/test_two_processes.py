"""Training by two processes (torchrun, gloo)."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.two_processes import check_killed_and_resumed, check_two_processes


@pytest.mark.slow
def test_two_processes_train_every_stage_and_resume_exactly(tmp_path: Path) -> None:
    assert check_two_processes(tmp_path, "hgm3") == {"tokenizer", "masked", "residual", "length"}


@pytest.mark.slow
def test_two_processes_that_are_killed_and_resumed_end_with_the_same_weights(tmp_path: Path) -> None:
    check_killed_and_resumed(tmp_path, "hgm3", ["tokenizer"], "masked")
