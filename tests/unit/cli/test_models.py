"""`marey models list`: what it says of bundles that are left out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from marey.cli.commands import models
from marey.core.settings import settings
from tests.support.live_api import BUNDLE, write_bundle


def test_a_bundle_is_shown_with_its_actions(capsys: pytest.CaptureFixture[str]) -> None:
    models.show("hgm3-starter", local=True)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("actions ")]
    assert lines == [
        "actions      supported: walk, walk-backward, run, turn, wave, raise-arm, bow",
        "actions      tried: kick, punch, slash, dance",
    ]


def test_a_bundle_without_actions_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_bundle(tmp_path)
    monkeypatch.setattr(settings(), "models", tmp_path)
    models.show(BUNDLE, local=True)
    assert "actions      not listed" in capsys.readouterr().out


def test_broken_bundles_are_told_beside_the_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_bundle(tmp_path)
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "manifest.json").write_text("{")
    monkeypatch.setattr(settings(), "models", tmp_path)
    monkeypatch.setattr(settings(), "home", tmp_path / "home")
    models.list_models(local=True, as_json=True)
    out, err = capsys.readouterr()
    assert [json.loads(line)["name"] for line in out.splitlines()] == [BUNDLE]
    assert err.startswith("left out: broken: manifest.json: is not JSON")
