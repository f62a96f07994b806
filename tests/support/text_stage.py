"""The text stage without its model: features that depend on the prompt alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from marey.db import transaction
from marey.items.timeline import prompts_with_rows
from marey.jobs import NewText, claim, commit_texts
from marey.jobs.types import prompts_of_ops
from marey.text.several import SeveralTexts
from tests.support.live_api import LiveApi
from tests.support.prepared import text_features


def read(prompt: str) -> Any:
    return replace(text_features(sum(prompt.encode()), 1, 1), prompt=prompt, rewritten=prompt)


def read_texts(api: LiveApi) -> list[tuple[str, ...]]:
    """Do what the text stage would, and return the prompts of each item."""
    told: list[tuple[str, ...]] = []
    with transaction(api.engine) as conn:
        while found := claim(conn, "text", "hands", 64):
            texts: list[NewText] = []
            for item in found.items:
                told.append(_prompts(item))
                several = SeveralTexts(tuple(read(prompt) for prompt in told[-1]))
                single = item.edits is None and item.timeline is None
                texts.append(NewText(item.id, item.text_key, (several.texts[0] if single else several).to_blob()))
            commit_texts(conn, found.lease_token, texts)
    return told


def _prompts(item: Any) -> tuple[str, ...]:
    if item.edits is not None:
        return prompts_of_ops(item.edits.ops)
    return tuple(prompt for _, prompt in prompts_with_rows(item.prompt, item.timeline))
