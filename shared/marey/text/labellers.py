"""Labellers that wrap another one, or none."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from marey.text.keys import NO_LABELLER
from marey.text.roles import Frame, RoleLabeller


class NoLabeller:
    """Finds nothing: every graph is its motion node alone. For ablations; it has to be asked for by name."""

    name = NO_LABELLER
    sha256 = ""

    def label(self, sentences: Sequence[Sequence[str]]) -> list[tuple[Frame, ...]]:
        """No frames."""
        return [() for _ in sentences]


class OneAtATime:
    """A labeller that serves one thread after the other; their networks and tokenizers promise no more."""

    def __init__(self, labeller: RoleLabeller) -> None:
        self._labeller = labeller
        self._lock = threading.Lock()
        self.name = labeller.name
        self.sha256 = labeller.sha256

    def label(self, sentences: Sequence[Sequence[str]]) -> list[tuple[Frame, ...]]:
        """Its frames."""
        with self._lock:
            return self._labeller.label(sentences)
