"""Cells of the CSV files that the command line writes: spreadsheets show them as text, and reading them back is exact.

A spreadsheet runs a cell as a formula if it begins with `=`, `+`, `-`, `@`, a tab or a carriage return. Such text gets
an apostrophe in front, and so does text that looks as if it had got one. Numbers stay numbers. Standard library only.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection, Iterable, Mapping, Sequence

TAG_SEPARATOR = ";"
_FORMULA = re.compile(r"'*[=+\-@\t\r]")
_PREFIXED = re.compile(r"'+[=+\-@\t\r]")
_NUMBER = re.compile(r"-?[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?")


def protect(text: str) -> str:
    """The cell for a text: `=1+1` becomes `'=1+1`, and `'=1+1` becomes `''=1+1`."""
    return f"'{text}" if _FORMULA.match(text) else text


def restore(cell: str) -> str:
    """The text of a cell that `protect` gave."""
    return cell[1:] if _PREFIXED.match(cell) else cell


def join_tags(tags: Sequence[str]) -> str:
    """One cell for all tags: `day=1; take 2`. A tag that holds the separator is quoted."""
    return f"{TAG_SEPARATOR} ".join(_quoted(tag) for tag in tags)


def split_tags(cell: str) -> list[str]:
    """The tags of a cell that `join_tags` gave."""
    return next(csv.reader([cell], delimiter=TAG_SEPARATOR, skipinitialspace=True), list[str]())


def write_csv(columns: Sequence[str], rows: Iterable[Mapping[str, str]], *, numbers: Collection[str]) -> bytes:
    """A CSV file in UTF-8.

    Args:
        columns: of the file, in order.
        numbers: columns whose numbers stand as they are; everything else is text.
    """
    buffer = io.StringIO(newline="")
    writer = csv.DictWriter(buffer, columns)
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _cell(row[name], is_number=name in numbers) for name in columns})
    return buffer.getvalue().encode()


def _cell(text: str, *, is_number: bool) -> str:
    return text if is_number and _NUMBER.fullmatch(text) else protect(text)


def _quoted(tag: str) -> str:
    plain = tag == tag.strip() and not set(tag) & {TAG_SEPARATOR, '"'}
    return tag if plain else '"{}"'.format(tag.replace('"', '""'))
