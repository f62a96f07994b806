"""Control characters stay out of free text, and out of what is shown."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.core.characters import (
    FORBIDDEN,
    LINES,
    STORED,
    WHITESPACE,
    check_text,
    escape,
    escape_json,
    find_forbidden,
    normalize_newlines,
)
from marey.core.errors import InvalidInput

REFUSED = [*range(0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A), 0xD800, 0xDBFF, 0xDFFF]
TEXT = st.text(st.characters(), max_size=60)  # with surrogates


@pytest.mark.parametrize("code", REFUSED)
def test_each_control_character_is_refused_by_its_number(code: int) -> None:
    with pytest.raises(InvalidInput) as caught:
        check_text(f"a{chr(code)}b", where="name")
    assert caught.value.where == "name"
    assert "NUL" in caught.value.message if code == 0 else f"U+{code:04X}" in caught.value.message


@pytest.mark.parametrize(
    "text", ["", "Zoë", "日本 🕺🏽", "می\u200cخواهم", "👩\u200d🚀", "\u200eabc\u200f", "a\u00a0b", "\u061c"]
)
def test_text_of_any_script_with_its_marks_stays_as_it_is(text: str) -> None:
    assert check_text(text) == text
    assert escape(text) == text


def test_newlines_and_tabs_stand_where_they_are_allowed() -> None:
    assert check_text("a\n\tb", allowed=LINES) == "a\n\tb"
    assert check_text("a\r\n\tb", allowed=WHITESPACE)
    assert check_text("a\x1b\u202eb", allowed=STORED)
    refused = (("a\nb", ""), ("a\rb", LINES), ("a\x0bb", WHITESPACE), ("a\x85b", WHITESPACE), ("\0", STORED))
    for text, allowed in refused:
        with pytest.raises(InvalidInput):
            check_text(text, allowed=allowed)
    assert normalize_newlines("a\r\nb\r") == "a\nb\r"


@given(TEXT)
def test_what_is_shown_holds_no_control_character(text: str) -> None:
    assert find_forbidden(escape(text, lines=False)) is None
    assert find_forbidden(escape(text), LINES) is None
    assert escape(text).encode().decode() == escape(text)
    assert escape(escape(text)) == escape(text)
    assert (find_forbidden(text) is None) == (FORBIDDEN.search(text) is None)


@given(TEXT)
def test_json_that_is_shown_holds_no_control_character_and_reads_as_before(text: str) -> None:
    for ascii_only in (True, False):
        shown = escape_json(json.dumps({text: [text]}, ensure_ascii=ascii_only))
        assert find_forbidden(shown) is None
        assert json.loads(shown) == {text: [text]}
