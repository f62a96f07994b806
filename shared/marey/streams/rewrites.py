"""Rewrites of the prompts of a stream."""

from __future__ import annotations

from typing import NamedTuple


class PromptRewrite(NamedTuple):
    """Text that the model received for a prompt."""

    rewritten: str
    """The prompt itself if no rewriter changed it."""
    not_rewritten: str | None = None
    """Reason why a rewrite was not used."""
