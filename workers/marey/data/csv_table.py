"""Strict reading of the CSV files of a data folder: a row that is not as the header says is an error with its line."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass

from marey.core.characters import WHITESPACE, check_text
from marey.core.errors import InvalidFile, InvalidInput

OTHER_DELIMITERS = {";": "semicolons", "\t": "tabs", "|": "bars"}


@dataclass(frozen=True)
class CsvTable:
    """The text of a table with a header.

    Attributes:
        header: names of the columns.
        where: its file, for errors.
    """

    header: tuple[str, ...]
    where: str
    _lines: Iterator[tuple[int, list[str]]]

    @classmethod
    def of(cls, text: str, where: str) -> CsvTable:
        """Read the header.

        Raises:
            InvalidFile: a column stands in it twice, or it cannot be read.
        """
        lines = _lines(text, where)
        _, header = next(lines, (1, list[str]()))
        names = tuple(header)
        twice = next((name for name in names if name and names.count(name) > 1), None)
        if twice is not None:
            raise InvalidFile(f"has two columns {twice!r}", where=where)
        return cls(names, where, lines)

    def rows(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Yield the place of each row below the header, as `index.csv, line 3`, with its cells by column. Blank rows
        are left out.

        Raises:
            InvalidFile: a row has another number of cells than the header, a quote is never closed, or a cell holds a
                control character.
        """
        for line, cells in self._lines:
            place = f"{self.where}, line {line}"
            if not any(map(str.strip, cells)):
                continue
            if len(cells) != len(self.header):
                raise InvalidFile(
                    f"has {len(cells)} cell{'s' * (len(cells) != 1)}, the header {len(self.header)}",
                    where=place,
                    hint="An empty cell needs its comma too; quote cells that hold commas.",
                )
            for name, cell in zip(self.header, cells, strict=True):
                try:
                    check_text(cell, allowed=WHITESPACE, subject=f"`{name}`")
                except InvalidInput as error:
                    raise InvalidFile(error.message, where=place, hint=error.hint) from None
            yield place, dict(zip(self.header, cells, strict=True))

    def hint_of_delimiter(self) -> str | None:
        """Return a hint where the header seems to have other delimiters than commas."""
        (name,) = self.header if len(self.header) == 1 else ("",)
        used = next((said for sign, said in OTHER_DELIMITERS.items() if sign in name), None)
        return None if used is None else f"Its cells are separated by {used}: save it with commas."


def _lines(text: str, where: str) -> Iterator[tuple[int, list[str]]]:
    """Yield rows with the line where each begins."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    while True:
        line = reader.line_num + 1
        try:
            yield line, next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            said = "a quote is never closed" if "end of data" in str(error) else str(error)
            raise InvalidFile(f"is not CSV: {said}", where=f"{where}, line {line}") from None
