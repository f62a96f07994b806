"""One file of a fetch: where it is, what it is to hold, and how it comes about."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from marey.exporters.making import FileRecipe

FORMAT = re.compile(r"[a-z0-9]{1,16}")
"""File formats that a server may name; the format is the extension if its exporter is not installed."""
OF_A_MOTION = re.compile(r"/v1/motions/([^/?]+)/files/[^/?]+")


@dataclass(frozen=True)
class FileToFetch:
    """One file to fetch."""

    url: str
    """Path on the server."""
    sha256: str
    size: int
    path: Path
    making: FileRecipe | None = None
    """How the file is made of what the server sends; None = it is that."""
    asked: Mapping[str, str | bool] | None = None
    """Options of a file that the server makes; None = it is stored. Its `sha256` and `size` are not known before."""

    @property
    def format(self) -> str:
        """The format of the file, such as `npz`."""
        return self.stored_format if self.making is None else self.making.format

    @property
    def stored_format(self) -> str:
        """The format of what the server sends."""
        return self.url.rpartition("/")[2]

    @property
    def motion(self) -> str | None:
        """Id of the motion whose stored file the server sends; None = another file."""
        found = OF_A_MOTION.fullmatch(self.url)
        return None if found is None else found[1]
