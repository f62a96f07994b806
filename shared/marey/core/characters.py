"""Characters that free text may not hold, and how text that holds them is displayed.

Terminals execute control characters, and direction overrides display text in another order than it is stored in.
Incoming text is checked once, at the edge, by `check_text`; text for a terminal or a log passes `escape`, because
rows of earlier releases may hold any character. Standard library only: the small client imports it.
"""

from __future__ import annotations

import re
from typing import Any, TextIO, cast

from marey.core.errors import InvalidInput

LINES = "\n\t"
"""Control characters allowed in multi-line text, such as comments."""
WHITESPACE = "\n\r\t"
"""Control characters allowed in text whose whitespace is normalised, such as prompts."""
_CLASS = r"\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069"
"""C0, DEL, C1, and the overrides and isolates of text direction."""
MARKS = "\u200c\u200d\u200e\u200f"
"""ZWNJ, ZWJ, LRM and RLM are not forbidden: Persian, Hindi, Hebrew and emoji need them."""
FORBIDDEN = re.compile(rf"[{_CLASS}\ud800-\udfff]")
STORED = "".join(map(chr, (*range(1, 0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A))))
"""Forbidden characters that rows of earlier releases may hold: all but NUL and surrogates, which Postgres refuses."""
_SHOWN_RAW = re.compile(rf"(?![{LINES}])[{_CLASS}\ud800-\udfff]")
LINE_PATTERN = rf"^[^{_CLASS}]*$"
"""JSON Schema pattern for single-line text; surrogates cannot be written there."""
TEXT_PATTERN = r"^[^\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]*$"
"""JSON Schema pattern for text that may hold `LINES`."""


def check_text(text: str, *, allowed: str = "", subject: str = "it", where: str | None = None) -> str:
    """Return the text; raise if it holds a character that may not be in free text.

    Args:
        allowed: allowed control characters: `LINES`, `WHITESPACE`, `STORED`, or none.
        subject: beginning of the message, such as `the prompt`.
        where: field, line or option, for the error.

    Raises:
        InvalidInput: names the first forbidden character and its position.
    """
    found = find_forbidden(text, allowed)
    if found is None:
        return text
    character, place = found, text.index(found) + 1
    code = f"U+{ord(character):04X}"
    if character == "\0":
        raise InvalidInput(f"{subject} holds a NUL byte", where=where, hint="Is the file plain UTF-8 text?")
    if "\ud800" <= character <= "\udfff":
        raise InvalidInput(
            f"{subject} holds broken Unicode (a lone surrogate, {code})", where=where, hint="Save it as UTF-8."
        )
    kind = "text direction control" if "\u202a" <= character <= "\u2069" else "control character"
    raise InvalidInput(f"{subject} holds the {kind} {code} at character {place}", where=where, hint="Remove it.")


def find_forbidden(text: str, allowed: str = "") -> str | None:
    """Return the first character that free text may not hold; None if there is none."""
    if text.isascii() and text.isprintable():  # nearly all text: a request may hold 100,000 prompts
        return None
    return next((match.group() for match in FORBIDDEN.finditer(text) if match.group() not in allowed), None)


def is_printable(text: str) -> bool:
    """Return True if every character has a shape of its own, or is a mark that shapes its neighbours (`MARKS`)."""
    return text.isprintable() or all(c.isprintable() or c in MARKS for c in text)


def normalize_newlines(text: str) -> str:
    """Replace `\\r\\n`, which web forms and Windows send, by `\\n`."""
    return text.replace("\r\n", "\n")


def escape(text: str, *, lines: bool = True) -> str:
    r"""Escape each forbidden character for a terminal, as `\x1b`, `\u202e`, `\ud800`.

    Args:
        lines: keep newlines and tabs; otherwise they are escaped too.
    """
    return (_SHOWN_RAW if lines else FORBIDDEN).sub(_escaped, text)


def escape_json(text: str) -> str:
    r"""Escape forbidden characters in JSON strings, as `\u001b`, `\u202e`, `\ud800`; the values stay equal."""
    return _SHOWN_RAW.sub(lambda match: f"\\u{ord(match.group()):04x}", text)


def _escaped(match: re.Match[str]) -> str:
    code = ord(match.group())
    named = {"\n": "\\n", "\t": "\\t", "\r": "\\r"}.get(match.group())
    return named or (f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}")


class EscapingStream:
    """Text stream that escapes forbidden characters in everything written to it.

    Attributes:
        unescaped: the wrapped stream, for code that draws on the terminal.
    """

    def __init__(self, unescaped: TextIO) -> None:
        self.unescaped = unescaped

    def write(self, text: str) -> int:
        """Write the text, escaped; return its length as it was given."""
        self.unescaped.write(escape(text))
        return len(text)

    def writelines(self, lines: Any) -> None:
        """Write all of them."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unescaped, name)


def unescaped(stream: TextIO) -> TextIO:
    """Return the stream behind an `EscapingStream`, else the stream itself."""
    return stream.unescaped if isinstance(stream, EscapingStream) else stream


def escaping(stream: TextIO | None) -> TextIO | None:
    """Wrap a stream in an `EscapingStream`; None stays None (a process without a console has no streams). Characters
    that its encoding does not have are escaped as well."""
    if stream is None or isinstance(stream, EscapingStream):
        return stream
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:  # not of a stream that a test or a program put in its place
        reconfigure(errors="backslashreplace")
    return cast("TextIO", EscapingStream(stream))
