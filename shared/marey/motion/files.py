"""Writing files whole or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from marey.core.errors import InvalidInput


def write_atomically(path: Path, data: bytes) -> None:
    """A new file beside `path`, then a rename: nobody ever sees half a file.

    Raises:
        InvalidInput: the folder is missing or cannot be written to.
    """
    part = path.parent / f".{path.name[:40]}.{secrets.token_hex(4)}.part"
    try:
        handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise InvalidInput(f"cannot be written: {error.strerror}", where=str(path)) from None
