"""A request body of one JSON object a line, kept in a file once it is long."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Self

from marey.core.spool import Spool

PIECE = 64 * 2**10
"""Bytes that are sent at a time."""
HINT = "Make room on the disk of temporary files, or name a folder with room by TMPDIR."


class Lines:
    """NDJSON that can be sent as often as it takes, and is never in memory as a whole."""

    def __init__(self, objects: Iterable[Mapping[str, Any]]) -> None:
        """Write all objects to a temporary file, which is removed if reading them fails.

        Raises:
            Unreachable: the disk of temporary files is full.
        """
        self._spool = Spool("the prompts", HINT)
        try:
            for each in objects:
                self._spool.write(json.dumps(each, ensure_ascii=False).encode() + b"\n")
            self._spool.rewound()  # write the buffer before anything is sent
        except BaseException:
            self.__exit__()
            raise

    def __len__(self) -> int:
        """Bytes."""
        return len(self._spool)

    def __iter__(self) -> Iterator[bytes]:
        """The body from its beginning, in pieces."""
        file = self._spool.rewound()
        while piece := file.read(PIECE):
            yield piece

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._spool.__exit__()
