"""Prompts that a language model rewrites, through the command line and the queue."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from marey.motion.clip import load_npz
from tests.support.language_model import ChatRequest, CompletionReply, LanguageModel
from tests.support.marey import Marey

STROLL, RUN, LOST = "he strolls to the left", "he is running", "he jumps"
CAPTION = "A person strolls to the left."


def answer(asked: ChatRequest, before: int) -> CompletionReply:
    said = {
        STROLL: CompletionReply(CAPTION),
        RUN: CompletionReply("A person bows."),
        LOST: CompletionReply("", status=404),
    }
    return said[asked.prompt]


@pytest.fixture
def model(language_model: LanguageModel, monkeypatch: pytest.MonkeyPatch) -> LanguageModel:
    monkeypatch.setattr(language_model, "answer", answer)
    monkeypatch.setattr(language_model, "asked", [])
    return language_model


def test_a_one_shot_tells_what_it_read(offline: Marey, model: LanguageModel, tmp_path: Path) -> None:
    own = {"MAREY_REWRITER": "openai", "MAREY_REWRITER_URL": model.url, "MAREY_REWRITER_MODEL": "any"}
    made = replace(offline, environment=own)(
        "generate", STROLL, RUN, LOST, "--seconds", 1, "-o", tmp_path / "out", "--format", "npz", "--json"
    ).ok()  # fmt: skip
    told = " ".join(made.err.split())
    assert f"'{STROLL}' was read as '{CAPTION}'." in told
    assert f"'{RUN}' was read as it is: it changes the verbs: run became bow." in told
    assert f"'{LOST}' was read as it is: the language model answered with status 404." in told
    assert [load_npz(line["files"]["npz"]).manifest["rewritten"] for line in made.lines] == [CAPTION, RUN, LOST]


def test_a_motion_of_the_queue_keeps_both_prompts(served: Marey, model: LanguageModel, tmp_path: Path) -> None:
    made = served("submit", STROLL, LOST, "--seconds", 1, "--fetch", tmp_path, "--json").ok().lines
    with served.client() as client:
        shown = client.get(f"/v1/motions/{made[0]['motion']}")
    first, second = (load_npz(line["files"]["npz"]).manifest for line in made)
    assert (first["prompt"], first["rewritten"]) == (STROLL, CAPTION)
    assert shown["metadata"]["rewritten"] == CAPTION
    assert (second["prompt"], second["rewritten"]) == (LOST, LOST)
    assert second["not_rewritten"] == "the language model answered with status 404"
    assert sorted(asked.prompt for asked in model.asked) == sorted([STROLL, LOST])
