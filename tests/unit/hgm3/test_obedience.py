"""Judging a bundle: the report of a random one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from marey.core.errors import InvalidInput
from marey.models.hgm3.bundle import random_bundle
from marey.models.hgm3.obedience import main


def test_a_report_counts_each_prompt_and_seed(tmp_path: Path) -> None:
    bundle = random_bundle(tmp_path / "tiny", "tiny")
    main([str(bundle.path), "--seeds", "2", "--every", "50", "--set", "steps=2", "-o", str(tmp_path / "report")])
    found = json.loads((tmp_path / "report" / "report.json").read_text())
    assert len(found["trials"]) == 8
    assert found["settings"]["steps"] == 2
    assert found["summary"]["one action"]["clips"] > 0


@pytest.mark.parametrize("setting", ["steps", "steps=many", "wings=2"])
def test_a_setting_that_is_none_is_refused(tmp_path: Path, setting: str) -> None:
    bundle = random_bundle(tmp_path / "tiny", "tiny")
    with pytest.raises(InvalidInput):
        main([str(bundle.path), "--every", "100", "--set", setting])
