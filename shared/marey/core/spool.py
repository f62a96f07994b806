"""Bytes sent or received by a process, kept in a file above a size so that memory does not grow."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from typing import BinaryIO, Self, cast

from marey.core.errors import Unreachable

IN_MEMORY = 2**20
"""Bytes kept in memory; larger content goes to an unnamed file, which ends with the process at the latest."""


class Spool:
    """Buffer that is written once, then read from its beginning any number of times.

    A full disk may show at a write, at a flush or at close; all raise the same error.
    """

    def __init__(self, where: str, hint: str) -> None:
        """Set `where` and `hint` of the error that a full disk raises."""
        self._file = tempfile.SpooledTemporaryFile(IN_MEMORY)  # noqa: SIM115 (closed by __exit__)
        self._size = 0
        self._where = where
        self._hint = hint

    def write(self, part: bytes) -> None:
        """Append bytes.

        Raises:
            Unreachable: the disk is full.
        """
        with self._room():
            self._file.write(part)
        self._size += len(part)

    def rewound(self) -> BinaryIO:
        """Yield the buffer at its beginning, for reading inside the block.

        Raises:
            Unreachable: the disk is full.
        """
        with self._room():
            self._file.seek(0)
        return cast("BinaryIO", self._file)

    def __len__(self) -> int:
        """Number of bytes written."""
        return self._size

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):  # close retries a failed flush, whose error was already raised
            self._file.close()

    @contextmanager
    def _room(self) -> Generator[None]:
        try:
            yield
        except OSError as error:
            reason = os.strerror(error.errno or errno.EIO)  # the original message may name folders of this machine
            raise Unreachable(
                f"cannot be kept: {reason}",
                where=self._where,
                hint=self._hint,
                public=f"cannot be kept: {reason}",
            ) from error
