"""Prompts that a model does not know: refused at once by their words, or in the text stage by their meaning."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.marey import Marey, tiny

LISTED = "hgm3-listed"


@pytest.fixture
def listed(models: Path) -> Iterator[str]:
    """A bundle that lists its actions, for one test."""
    folder = models / LISTED
    shutil.copytree(models / tiny("hgm3"), folder)
    manifest = folder / "manifest.json"
    actions = {"supported": ["walk", "wave"], "single_take": [], "tried": []}
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"name": LISTED, "actions": actions}))
    yield LISTED
    shutil.rmtree(folder)


def test_refuse_is_2_by_words_and_6_by_meaning(marey: Marey, listed: str) -> None:
    options = ("--bundle", listed, "--scope", "refuse", "--seconds", 2)
    marey("submit", "asdf qwer zxcv", *options).refused(2, "does not know", f"{listed} knows: walk, wave.")
    submitted = marey("submit", "a wave of nausea", "a person walks", *options, "--json").ok()
    job = json.loads(submitted.out)["id"]
    marey("jobs", "wait", job, "--timeout", 120).refused(6, "1 failed of 2 items")
    with marey.client() as client:
        failed, made = client.get(f"/v1/jobs/{job}/items")["items"]
    assert (failed["state"], failed["stage"], failed["error"]["type"]) == ("failed", "text", "out-of-scope")
    assert (made["state"], made["scope"]["verdict"]) == ("succeeded", "known")
