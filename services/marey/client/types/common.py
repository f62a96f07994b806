"""Parts that results of several nouns share."""

from __future__ import annotations

from dataclasses import dataclass

from marey.client.results import Result


@dataclass(frozen=True, kw_only=True)
class File(Result):
    """A stored file."""

    format: str = ""
    sha256: str = ""
    size: int = 0
    media_type: str = ""


@dataclass(frozen=True, kw_only=True)
class ErrorDetail(Result):
    """The reason why an item has no result."""

    type: str = ""
    message: str = ""
    where: str | None = None
    hint: str | None = None
