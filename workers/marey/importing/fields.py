"""Configurations of other projects: `opt.txt`, YAML and JSON, with typed fields whose errors name file and field."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from marey.core.documents import read_bytes, read_json
from marey.core.errors import InvalidFile

MAX_BYTES = 2**20
MAX_SECTIONS = 10_000
"""Sections that a search reads: anchors of YAML repeat sections without end."""
HINT = "Is it the file that came with the weights? Download it again."
INTEGER, DECIMAL = re.compile(r"[-+]?\d+"), re.compile(r"[-+]?\d+\.\d+")


@dataclass(frozen=True)
class Fields:
    """Values of one configuration by name.

    Attributes:
        where: file, and section within it, for errors.
        values: plain values.
    """

    where: str
    values: Mapping[str, Any]

    def __contains__(self, name: object) -> bool:
        """Return True if there is a field of this name."""
        return name in self.values

    def section(self, name: str) -> Fields:
        """Return the fields of a nested section.

        Raises:
            InvalidFile: there is none.
        """
        found = self._found(name)
        if not isinstance(found, Mapping):
            raise self._not(name, found, "a section")
        return Fields(f"{self.where}: {name}", found)

    def integer(self, name: str, default: int | None = None) -> int:
        """Return a whole number; `default` where the field is missing.

        Raises:
            InvalidFile: it is something else, or missing without a default.
        """
        found = self._found(name, default)
        if isinstance(found, float) and found.is_integer():
            return int(found)
        if not isinstance(found, int) or isinstance(found, bool):
            raise self._not(name, found, "a whole number")
        return found

    def size(self, name: str, high: int, *, low: int = 1, default: int | None = None) -> int:
        """Return a whole number between `low` and `high`, both included: a size beyond them is damaged.

        Raises:
            InvalidFile: it is outside, something else, or missing without a default.
        """
        value = self.integer(name, default)
        if not low <= value <= high:
            raise InvalidFile(f"{name}: {value} is outside {low} to {high}", where=self.where, hint=HINT)
        return value

    def number(self, name: str, default: float | None = None) -> float:
        """Return a finite number; `1e-05` counts, which both formats read as text. See `integer`."""
        found = self._found(name, default)
        try:
            value = math.nan if isinstance(found, bool) else float(found)
        except (TypeError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            raise self._not(name, found, "a number")
        return value

    def flag(self, name: str, default: bool | None = None) -> bool:
        """Return True or False; see `integer`."""
        found = self._found(name, default)
        if not isinstance(found, bool):
            raise self._not(name, found, "True or False")
        return found

    def text(self, name: str, default: str | None = None) -> str:
        """Return text; see `integer`. `None` in either file is the text "None"."""
        found = self._found(name, default) if name not in self.values or self.values[name] is not None else "None"
        if not isinstance(found, str):
            raise self._not(name, found, "text")
        return found

    def integers(self, name: str, default: tuple[int, ...] | None = None) -> tuple[int, ...]:
        """Return a list of whole numbers; see `integer`."""
        found = self._found(name, default)
        if not isinstance(found, list | tuple) or any(not isinstance(n, int) or isinstance(n, bool) for n in found):
            raise self._not(name, found, "a list of whole numbers")
        return tuple(found)

    def expect(self, name: str, *wanted: Any) -> None:
        """Check that a field, where it is given, has one of these values.

        Raises:
            InvalidFile: it has another.
        """
        if name in self.values and self.values[name] not in wanted:
            raise self._not(name, self.values[name], " or ".join(map(repr, wanted)))

    def search(self, pattern: str) -> dict[str, Any]:
        """Return the values at any depth whose name matches a regular expression as a whole, by path, such as
        `model.n_heads`."""
        found: dict[str, Any] = {}
        left: list[tuple[str, Mapping[str, Any]]] = [("", self.values)]
        for _ in range(MAX_SECTIONS):
            if not left:
                break
            path, values = left.pop()
            for name, value in values.items():
                if isinstance(value, Mapping):
                    left.append((f"{path}{name}.", value))
                elif re.fullmatch(pattern, str(name)):
                    found[f"{path}{name}"] = value
        return found

    def _found(self, name: str, default: Any = None) -> Any:
        found = self.values.get(name, default)
        if found is None:
            raise InvalidFile(f"has no {name!r}", where=self.where, hint=HINT)
        return found

    def _not(self, name: str, found: object, wanted: str) -> InvalidFile:
        return InvalidFile(f"{name}: is {str(found)[:80]!r}, not {wanted}", where=self.where, hint=HINT)


def read_options(file: Path) -> Fields:
    """Read an `opt.txt`: lines `key: value`, of which True, False, whole and decimal numbers are values.

    Lines without a colon are skipped: a copy in circulation has `window_size = 64`.

    Raises:
        NotFound: there is no such file.
        InvalidFile: too large, not text, or without one readable line.
    """
    values: dict[str, Any] = {}
    for line in _text(file).splitlines():
        key, colon, value = line.partition(":")
        if colon and key.strip() and " " not in key.strip():
            values[key.strip()] = _value(value.strip())
    if not values:
        raise InvalidFile("holds no lines `key: value`", where=str(file), hint=HINT)
    return Fields(str(file), values)


def read_yaml(file: Path) -> Fields:
    """Read a YAML file of plain values.

    Raises:
        NotFound: there is no such file.
        InvalidFile: too large, not YAML, with Python objects, or no table of fields.
    """
    import yaml

    try:
        values: Any = yaml.safe_load(_text(file))
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise InvalidFile(f"is not YAML of plain values: {reason}", where=str(file), hint=HINT) from None
    if not isinstance(values, Mapping):
        raise InvalidFile("holds no table of fields", where=str(file), hint=HINT)
    return Fields(str(file), values)


def read_json_fields(file: Path) -> Fields:
    """Read a JSON file.

    Raises:
        NotFound: there is no such file.
        InvalidFile: too large, not JSON, or no table of fields.
    """
    values: Any = read_json(file, limit=MAX_BYTES, hint=HINT)
    if not isinstance(values, Mapping):
        raise InvalidFile("holds no table of fields", where=str(file), hint=HINT)
    return Fields(str(file), values)


def _text(file: Path) -> str:
    try:
        return read_bytes(file, limit=MAX_BYTES, hint=HINT).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InvalidFile("is not text", where=str(file), hint=HINT) from None


def _value(text: str) -> bool | int | float | str:
    if text in ("True", "False"):
        return text == "True"
    if DECIMAL.fullmatch(text):
        return float(text)
    return int(text) if INTEGER.fullmatch(text) else text
