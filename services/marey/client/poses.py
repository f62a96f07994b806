"""Poses of motion files that rows name: read on this machine, since a server reads no files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from marey.core.errors import InvalidInput
from marey.items.problems import Problem
from marey.motion.keyframes import PoseFiles


class RowPoses:
    """Reads the motion files of rows, from the working directory."""

    def __init__(self) -> None:
        self._files = PoseFiles(Path())

    def read(self, values: Mapping[str, Any], line: int | None) -> tuple[dict[str, Any], list[Problem]]:
        """Return the fields of an item in which no constraint names a file, and the problem with one."""
        if not values.get("constraints"):
            return dict(values), []
        try:
            return {**values, "constraints": self._files.fill(values["constraints"])}, []
        except InvalidInput as error:
            return {name: value for name, value in values.items() if name != "constraints"}, [
                Problem(line, error.where, error.on_a_line)
            ]
