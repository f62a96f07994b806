"""JSON bodies with one long list, parsed from a file piece by piece: memory does not grow with the list.

Every value is decoded by Python's own `json`, as for a whole body. So the same documents are accepted, but for objects
that give a key twice, and errors have the same words, line and column. Only the enclosing object and the list's commas
are parsed here.
"""

from __future__ import annotations

import codecs
import json
import re
from collections.abc import Iterator
from json.decoder import JSONDecodeError
from typing import Any, BinaryIO

from marey.core.documents import RepeatedKeyError, json_problem, unique_object
from marey.core.errors import InvalidInput, TooLarge
from marey.items.item import MAX_ITEMS

MAX_VALUE = 2**20
"""Maximum characters of one element, and of all other fields together."""
PIECE = 2**20
"""Bytes per read."""
NEAR_END = 16
"""Characters: a truncated literal or escape is reported at its start, at most this far before the end."""
MAX_NAME = 100
"""Characters of a field's name that an error shows."""
BLANK = re.compile(r"[ \t\n\r]*")
_decoder = json.JSONDecoder(object_pairs_hook=unique_object)


class Document:
    """A JSON object in a file, with a list at a path, such as `items` or `request.prompts`.

    Args:
        body: the file; read from its beginning by each call.
        path: names of nested fields that lead to the list.
        hint: advice for a body that is not an object.
        limit: elements after which `fields` stops reading: the list is too long, which its reader reports.
    """

    def __init__(
        self, body: BinaryIO, path: tuple[str, ...], *, hint: str | None = None, limit: int = MAX_ITEMS
    ) -> None:
        self._body, self._path, self._hint, self._limit = body, path, hint, limit
        self.has_list = False
        """True if there is a list at the path. Set by `fields`, like the next attribute."""
        self.is_cut = False
        """True if it has more than `limit` elements; the rest was not read."""

    def fields(self) -> dict[str, Any]:
        """Return all fields but the list; a value in its place that is not a list is included.

        Raises:
            InvalidInput: not JSON, not an object, or a key occurs twice.
            TooLarge: an element, or the rest, is over `MAX_VALUE` characters.
        """
        found: dict[str, Any] = {}
        for number, _ in self._read(found):
            if number > self._limit:
                self.is_cut = True
                break
        return found

    def elements(self) -> Iterator[tuple[int, object]]:
        """Yield the elements of the list with their numbers, from 1; raises as `fields`."""
        return self._read({})

    def _read(self, fields: dict[str, Any]) -> Iterator[tuple[int, object]]:
        self.has_list = False
        window = _Window(self._body)
        if window.skip() != "{":
            window.value("body")
            window.end()
            raise InvalidInput("the body is not a JSON object", where="body", hint=self._hint)
        yield from self._object(window, self._path, fields)
        window.end()

    def _object(self, window: _Window, path: tuple[str, ...], fields: dict[str, Any]) -> Iterator[tuple[int, object]]:
        window.step()
        listed, deeper = path[0], path[1:]
        closed, seen = window.skip() == "}", set[str]()
        while not closed:
            if window.skip() != '"':
                raise window.error("Expecting property name enclosed in double quotes")
            name = str(window.field())
            if window.skip() != ":":
                raise window.error("Expecting ':' delimiter")
            window.step()
            begins = window.skip()
            if name in seen:
                where = ".".join(self._path) if name == listed else name[:MAX_NAME]
                raise InvalidInput("is given twice", where=where, hint="Give it once.")
            seen.add(name)
            if name == listed and not deeper and begins == "[":
                self.has_list = True
                yield from self._list(window)
            elif name == listed and deeper and begins == "{":
                fields[name] = {}
                yield from self._object(window, deeper, fields[name])
            else:
                fields[name] = window.field()
            closed = window.skip() == "}"
            if not closed:
                window.comma()
        window.step()

    def _list(self, window: _Window) -> Iterator[tuple[int, object]]:
        window.step()
        closed, number = window.skip() == "]", 0
        while not closed:
            window.skip()
            number += 1
            yield number, window.value(f"{'.'.join(self._path)}, element {number}")
            closed = window.skip() == "]"
            if not closed:
                window.comma()
        window.step()


class _Window:
    """Text of a file around the parser's position, with at least `MAX_VALUE` characters ahead, or the rest. Text behind
    the position is dropped; its lines are counted."""

    def __init__(self, body: BinaryIO) -> None:
        body.seek(0)
        encoding = json.detect_encoding(body.read(4))  # as `json.loads` of bytes does
        body.seek(0)
        self._body = body
        self._decode = codecs.getincrementaldecoder(encoding)("surrogatepass").decode
        self._bytes = 0  # read so far
        self._text, self._at, self._whole = "", 0, False
        self._gone, self._lines, self._line = 0, 0, 0  # characters, newlines, and where the last of these lines begins
        self._fields = 0  # characters of all fields so far

    def skip(self) -> str:
        """Skip blanks and return the next character; empty at the end."""
        while True:
            self._fill()
            found = BLANK.match(self._text, self._at)
            assert found is not None
            self._at = found.end()
            if self._at < len(self._text):
                return self._text[self._at]
            if self._whole:
                return ""

    def step(self) -> None:
        """Move behind the character that `skip` found."""
        self._at += 1

    def comma(self) -> None:
        """Move behind a comma; raise InvalidInput if there is none."""
        if self.skip() != ",":
            raise self.error("Expecting ',' delimiter")
        self._at += 1

    def end(self) -> None:
        """Raise InvalidInput if non-blank text is left."""
        if self.skip():
            raise self.error("Extra data")

    def field(self) -> object:
        """Parse a value outside the list, or a name; raises as `value`."""
        before = self._gone + self._at
        found = self.value("body")
        self._fields += self._gone + self._at - before
        if self._fields > MAX_VALUE:
            raise _too_large("body")
        return found

    def value(self, where: str) -> object:
        """Parse the value that begins here.

        Raises:
            InvalidInput: not JSON, or a key occurs twice.
            TooLarge: it has over `MAX_VALUE` characters.
        """
        self._fill()
        try:
            found, end = _decoder.raw_decode(self._text, self._at)
        except JSONDecodeError as error:
            cut = error.msg.startswith("Unterminated") or error.pos >= len(self._text) - NEAR_END
            if cut and not self._whole:
                raise _too_large(where) from None
            raise self.error(error.msg, error.pos) from None
        except RepeatedKeyError as error:
            raise InvalidInput(json_problem(error), where=where, hint="Give it once.") from None
        except (ValueError, RecursionError) as error:
            raise InvalidInput(f"the body {json_problem(error)}", where="body") from error
        if end - self._at > MAX_VALUE or (end == len(self._text) and not self._whole):
            raise _too_large(where)
        self._at = end
        return found

    def error(self, message: str, at: int | None = None) -> InvalidInput:
        """Return the error for invalid JSON, with the position that `json` reports for a whole text."""
        at = self._at if at is None else at
        line = self._lines + self._text.count("\n", 0, at) + 1
        newline = self._text.rfind("\n", 0, at)
        column = at - newline if newline >= 0 else self._gone + at - self._line + 1
        place = f"line {line} column {column} (char {self._gone + at})"
        return InvalidInput(f"the body is not JSON: {message}: {place}", where="body")

    def _fill(self) -> None:
        if self._whole or len(self._text) - self._at > MAX_VALUE:
            return
        self._forget()
        parts = [self._text]
        ahead = len(self._text)
        while not self._whole and ahead <= MAX_VALUE:
            read = self._body.read(PIECE)
            self._whole = not read
            try:
                parts.append(self._decode(read, final=self._whole))
            except UnicodeDecodeError as error:  # its object includes bytes that the decoder kept
                before = self._bytes - (len(error.object) - len(read))
                raise InvalidInput(f"the body {json_problem(error, before=before)}", where="body") from None
            self._bytes += len(read)
            ahead += len(parts[-1])
        self._text = "".join(parts)

    def _forget(self) -> None:
        newline = self._text.rfind("\n", 0, self._at)
        if newline >= 0:
            self._lines += self._text.count("\n", 0, self._at)
            self._line = self._gone + newline + 1
        self._gone += self._at
        self._text, self._at = self._text[self._at :], 0


def _too_large(where: str) -> TooLarge:
    return TooLarge(f"is over {MAX_VALUE:,} characters", where=where, hint="Is a quote or a bracket missing?")
