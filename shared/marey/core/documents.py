"""Read foreign files and JSON: sizes, nesting and kinds are checked, and every fault is an error of
`marey.core.errors`. Standard library only: the small client imports it."""

from __future__ import annotations

import json
import math
import os
import stat
from pathlib import Path
from typing import Any, cast

from marey.core.errors import InvalidFile, NotFound

MAX_DEPTH = 64
"""Levels of nesting. Marey's own documents have ten; recursive code behind a parser handles a thousand."""
MAX_JSON_BYTES = 64 * 2**20


def read_bytes(
    path: Path, *, limit: int, error: type[InvalidFile] = InvalidFile, where: str | None = None, hint: str | None = None
) -> bytes:
    """Read a regular file of at most `limit` bytes.

    Args:
        path: the file.
        limit: maximum size in bytes, checked before reading.
        error: class to raise for anything but a missing file.
        where, hint: for the error; by default the path, and no hint.

    Raises:
        NotFound: there is no such file.
        InvalidFile: a folder, pipe or device, a circular link, unreadable, or over the limit.
    """
    where = str(path) if where is None else where
    try:
        # Without O_NONBLOCK, opening a pipe would wait for a writer.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(descriptor, "rb") as file:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise error("is not a regular file", where=where, hint=hint)
            if status.st_size <= limit:
                data = file.read(limit + 1)
                if len(data) <= limit:
                    return data
        raise error(f"is over {limit:,} bytes", where=where, hint=hint)
    except FileNotFoundError:
        raise NotFound("there is no such file", where=where, hint=hint) from None
    except IsADirectoryError:
        raise error("is a folder, not a file", where=where, hint=hint) from None
    except OSError as failure:
        raise error(f"cannot be read: {failure.strerror}", where=where, hint=hint) from None
    except ValueError:  # a NUL in the path
        raise NotFound("there is no such file", where=where, hint=hint) from None


class RepeatedKeyError(ValueError):
    """A key that a JSON object has twice."""


def unique_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the object of these members; the `object_pairs_hook` of `json` for documents that people write: it would
    keep the last of equal keys, and the author cannot have meant both.

    Raises:
        RepeatedKeyError: two members have one key.
    """
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise RepeatedKeyError(next(key for key in keys if keys.count(key) > 1))
    return found


def json_problem(error: Exception, *, before: int = 0) -> str:
    """Return why `json` could not read a document, for people who do not know Python.

    Args:
        error: a `ValueError` or `RecursionError` of `json`.
        before: bytes of the document before those that `json` read.
    """
    if isinstance(error, RecursionError):
        return "is nested too deeply"
    if isinstance(error, RepeatedKeyError):
        return f"gives {error.args[0]!r} twice"
    if isinstance(error, UnicodeDecodeError):
        place = f"byte 0x{error.object[error.start]:02x} at position {before + error.start}"
        return f"is not {error.encoding.upper()} ({place})"
    if isinstance(error, json.JSONDecodeError):
        return f"is not JSON: {error}"
    return "holds a number of too many digits"


def parse_json(
    data: bytes | str,
    where: str,
    *,
    error: type[InvalidFile] = InvalidFile,
    hint: str | None = None,
    allow_nan: bool = False,
    unique: bool = False,
) -> Any:
    """Parse JSON in UTF-8.

    Args:
        data: the document.
        where, error, hint: for the error.
        allow_nan: accept NaN and infinite numbers, which Python writes and JSON does not have.
        unique: refuse objects that give a key twice.

    Raises:
        InvalidFile: not JSON, nested too deeply, a repeated key, or with text that is not Unicode.
    """
    try:
        text = data.decode("utf-8-sig") if isinstance(data, bytes) else data
        value = json.loads(text, object_pairs_hook=unique_object if unique else None)
        problem = _problem(value, allow_nan)
    except RecursionError:
        problem = f"is nested more than {MAX_DEPTH} levels deep"
    except ValueError as failure:
        problem = json_problem(failure)
    else:
        if problem is None:
            return value
    raise error(problem, where=where, hint=hint)


def read_json(
    path: Path,
    *,
    limit: int = MAX_JSON_BYTES,
    hint: str | None = None,
    allow_nan: bool = False,
    unique: bool = False,
) -> Any:
    """Read a JSON file.

    Raises:
        NotFound, InvalidFile: as `read_bytes` and `parse_json`.
    """
    data = read_bytes(path, limit=limit, hint=hint)
    return parse_json(data, str(path), hint=hint, allow_nan=allow_nan, unique=unique)


def _problem(value: Any, allow_nan: bool) -> str | None:
    """Return why a parsed document cannot be used, or None; works without recursion."""
    level = [value]
    for _ in range(MAX_DEPTH):
        inner: list[Any] = []
        for each in level:
            if isinstance(each, dict):
                members = cast("dict[str, Any]", each)
                inner += members
                inner += members.values()
            elif isinstance(each, list):
                inner += cast("list[Any]", each)
            elif isinstance(each, str):
                if not each.isascii() and not _is_unicode(each):
                    return "holds text that is not Unicode (a lone surrogate)"
            elif isinstance(each, float) and not allow_nan and not math.isfinite(each):
                return "holds a number that is not finite"
        if not inner:
            return None
        level = inner
    return f"is nested more than {MAX_DEPTH} levels deep"


def _is_unicode(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
