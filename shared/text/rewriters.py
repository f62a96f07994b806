"""Prompt rewriting: the port, `none` and `rules`."""

from __future__ import annotations

from typing import Protocol

from shared.errors import InvalidBundle


class PromptRewriter(Protocol):
    """Brings a prompt closer to the captions a model was trained on (MOGO's TCA; SnapMoGen Tab. 6)."""

    @property
    def name(self) -> str:
        """Name in `TextSpec.rewriter`."""
        ...

    def rewrite(self, prompt: str) -> str:
        """The rewritten prompt."""
        ...


class NoRewriter:
    """The prompt as it is. The default: rewriting trades FID for R-precision (MOGO Tab. 2)."""

    name = "none"

    def rewrite(self, prompt: str) -> str:
        """`prompt` itself."""
        return prompt


def load_rewriter(name: str) -> PromptRewriter:
    """The rewriter of that name.

    Raises:
        InvalidBundle: there is none.
    """
    if name == "none":
        return NoRewriter()
    raise InvalidBundle(f"there is no prompt rewriter {name!r}", hint="Known: none, rules.")
