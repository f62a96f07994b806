"""Constraints of `marey submit`: motion files are read here, and short references of stored motions become ids."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.cli.references import find, whole_id
from marey.core.errors import InvalidInput, NotFound
from marey.items.constraints import named_motions, parse_constraints
from marey.items.problems import Problem
from marey.motion.keyframes import read_constraints_file

if TYPE_CHECKING:
    from marey.client.rows import PromptReader
    from marey.items.item import Item

Constraints = Sequence[Mapping[str, Any]]


class StoredMotions:
    """Stored motions that constraints name; the server is asked once for each short reference."""

    def __init__(self) -> None:
        self._ids: dict[str, str] = {}

    def read_file(self, file: Path) -> Constraints:
        """Return the constraints of a JSON file, with whole ids; see `read_constraints_file`."""
        return read_constraints_file(file, lambda content: self._with_ids(parse_constraints(content)))

    def in_items(self, reader: PromptReader, items: Iterable[Item]) -> Iterator[Item]:
        """Yield the items of a reader with whole ids; motions that are not there are problems of it."""
        for item in items:
            try:
                yield replace(item, constraints=self._with_ids(item.constraints)) if item.constraints else item
            except InvalidInput as error:
                reader.add([Problem(reader.lines[-1], error.where, error.on_a_line)])
                yield replace(item, constraints=None)

    def _with_ids(self, constraints: Constraints) -> Constraints:
        named = named_motions(constraints)
        ids = {where: self._id(motion["id"], f"{where}.id") for where, motion in named if "id" in motion}
        return [
            {**each, "motion": {**each["motion"], "id": ids[where]}}
            if (where := f"constraints.{number}.motion") in ids
            else each
            for number, each in enumerate(constraints)
        ]

    def _id(self, reference: str, where: str) -> str:
        if (known := whole_id(reference) or self._ids.get(reference)) is not None:
            return known
        from marey.client import Client

        try:
            with Client() as client:
                self._ids[reference] = find(client, "motion", reference).id
        except (NotFound, InvalidInput) as error:
            raise InvalidInput(error.message, where=where, hint=error.hint) from None
        return self._ids[reference]
