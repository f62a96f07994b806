"""Results of `client.rigs`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from marey.client.results import Result


@dataclass(frozen=True, kw_only=True)
class Rig(Result):
    """A character's skeleton that the server puts motions on."""

    name: str
    version: int = 1
    """Counts the changes of its file and map."""
    format: str = ""
    sha256: str = ""
    """Of the file."""
    size: int = 0
    """Bytes of the file."""
    map: Mapping[str, str | None] | None = None
    """Joints that were named for parts of the body; None = none."""
    added_by: str = ""
    """Name of the key that added this version."""
    created: datetime | None = None
    updated: datetime | None = None
    """Time of this version."""


@dataclass(frozen=True, kw_only=True)
class RigDetail(Rig):
    """A rig, and what is found in it."""

    report: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Family, pose, unit, notes, and the joint of each part of the body; as `marey rigs show` tells."""
