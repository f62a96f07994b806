"""Labellers that wrap another one, or none."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from marey.text.keys import NO_LABELLER
from marey.text.roles import Frame, RoleLabeller


class NoLabeller:
    """A labeller without results: every graph is its motion node alone. For ablations; selected by name."""

    name = NO_LABELLER
    sha256 = ""

    def label(self, sentences: Sequence[Sequence[str]]) -> list[tuple[Frame, ...]]:
        """No frames."""
        return [() for _ in sentences]


class OneAtATime:
    """A thread-safe wrapper: labellers and their tokenizers are used by one thread at a time."""

    def __init__(self, labeller: RoleLabeller) -> None:
        self._labeller = labeller
        self._lock = threading.Lock()
        self.name = labeller.name
        self.sha256 = labeller.sha256

    def label(self, sentences: Sequence[Sequence[str]]) -> list[tuple[Frame, ...]]:
        """Its frames."""
        with self._lock:
            return self._labeller.label(sentences)
