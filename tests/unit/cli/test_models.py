"""`marey models list`: what it says of bundles that are left out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from marey.cli.commands import models
from marey.core.settings import settings
from tests.support.live_api import BUNDLE, write_bundle


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
