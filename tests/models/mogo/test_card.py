"""MOGO's streams and rollouts on a device that is not the processor."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.card_runs import run_check


@pytest.mark.slow
@pytest.mark.parametrize("check", ["streams", "rollouts"])
def test_mogo_streams_and_trains_on_a_device_of_its_own(check: str, tmp_path: Path) -> None:
    run_check("tests.models.mogo.card_checks", check, tmp_path)
