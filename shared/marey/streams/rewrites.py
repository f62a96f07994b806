"""Rewrites of the prompts of a stream."""

from __future__ import annotations

from typing import NamedTuple


class PromptRewrite(NamedTuple):
    """Text that the model received for a prompt."""

    rewritten: str
    """The prompt itself where no rewriter changed it."""
    not_rewritten: str | None = None
    """Why what a rewriter made of it was not used."""
