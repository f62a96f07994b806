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
    lines = capsys.readouterr().out.splitlines()
    assert lines[5:8] == [
        "Supported actions, and words that ask for them:",
        "  walk           walk, stroll, stride, march",
        "  walk-backward  walk backward, walk backwards, walk back, step back",
    ]
    assert [line.split()[0] for line in lines[6:13]] == [
        *("walk", "walk-backward", "run", "turn", "wave", "raise-arm", "bow")
    ]
    assert lines[13:16] == ["", "Tried actions, which may come out wrong:", "  kick, punch, slash, dance"]


def test_actions_of_few_captures_and_those_that_this_release_does_not_know_are_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    tried = [f"action-{number}" for number in range(9)]
    assert [*models._actions({"supported": ["bow"], "single_take": ["fly"], "tried": tried})] == [
        "",
        "Supported actions, and words that ask for them:",
        "  bow  bow, take a bow, bow down, bend forward in greeting",
        "",
        "Supported, but learned from few captures, and words that ask for them:",
        "  fly",
        "",
        "Tried actions, which may come out wrong:",
        "  action-0, action-1, action-2,",
        "  action-3, action-4, action-5,",
        "  action-6, action-7, action-8",
    ]


def test_a_bundle_without_actions_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_bundle(tmp_path)
    monkeypatch.setattr(settings(), "models", tmp_path)
    models.show(BUNDLE, local=True)
    assert "actions      not listed" in capsys.readouterr().out


def test_a_folder_is_shown_from_this_machine_though_a_server_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_bundle(tmp_path)
    monkeypatch.setenv("MAREY_SERVER", "http://127.0.0.1:1")
    monkeypatch.setenv("MAREY_KEY", "marey_key")
    models.show(str(tmp_path / BUNDLE))
    assert BUNDLE in capsys.readouterr().out


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
