"""Values found for the latest texts, for several threads: scope and features of a prompt are asked for apart."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

KEPT = 1024
"""Texts that are kept where nothing else is said."""


V = TypeVar("V")


class KeptTexts(Generic[V]):
    """Values of texts, of which the latest are kept."""

    def __init__(self, most: int = KEPT) -> None:
        """`most`: texts whose values are kept."""
        self._most = most
        self._kept: OrderedDict[str, V] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, texts: Sequence[str], find: Callable[[Sequence[str]], Sequence[V]]) -> list[V]:
        """Return the value of each text.

        Args:
            find: returns those of the texts that are not kept.
        """
        with self._lock:
            values = {text: self._kept[text] for text in texts if text in self._kept}
        missing = [text for text in dict.fromkeys(texts) if text not in values]
        if missing:
            values.update(zip(missing, find(missing), strict=True))
        with self._lock:
            for text, value in values.items():
                self._kept[text] = value
                self._kept.move_to_end(text)
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)
        return [values[text] for text in texts]
