"""JSON bodies that are read element by element: the same as `json.loads` reads, told in the same words."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from marey.api import documents
from marey.api.documents import Document
from marey.core.documents import json_problem
from marey.core.errors import InvalidInput, TooLarge

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=12,
)
OBJECTS = st.dictionaries(st.sampled_from(["name", "priority", "a\nb", ""]), VALUES, max_size=4)
LISTS = st.lists(VALUES, max_size=12)
LAYOUTS = st.sampled_from([{}, {"indent": 2}, {"indent": "\t", "separators": (" ,\r\n", " :\n")}])


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces and values so short that every body has many."""
    monkeypatch.setattr(documents, "PIECE", 7)
    monkeypatch.setattr(documents, "MAX_VALUE", 2000)


def read(body: bytes, path: tuple[str, ...] = ("items",)) -> dict[str, Any]:
    """The body as `json.loads` gives it, put together again."""
    document = Document(io.BytesIO(body), path)
    found = document.fields()
    assert list(document.elements()) == [] or document.has_list
    if document.has_list:
        inner = found
        for name in path[:-1]:
            inner = inner[name]
        inner[path[-1]] = [value for _, value in document.elements()]
    return found


def outcome(reader: Callable[[bytes], Any], body: bytes) -> str:
    """Result of a body: its value, or the error."""
    try:
        value = reader(body)
    except InvalidInput as error:
        return error.message
    except ValueError as error:
        return f"the body {json_problem(error)}"
    return (
        repr(sorted(value.items(), key=lambda pair: pair[0]))
        if isinstance(value, dict)
        else "the body is not a JSON object"
    )


@given(OBJECTS, LISTS, LAYOUTS, st.integers(0, 4), st.booleans())
def test_a_body_is_what_json_reads(
    others: dict[str, Any], items: list[Any], layout: dict[str, Any], at: int, ascii_only: bool
) -> None:
    pairs = list(others.items())
    pairs.insert(min(at, len(pairs)), ("items", items))
    body = json.dumps(dict(pairs), ensure_ascii=ascii_only, **layout).encode("utf-8", "surrogatepass")
    assert repr(read(body)) == repr({**others, "items": items})  # NaN is not equal to itself


@given(LISTS, OBJECTS)
def test_a_list_may_stand_deeper(items: list[Any], others: dict[str, Any]) -> None:
    whole = {"cron": "0 3 * * *", "request": {**others, "prompts": items}, "name": None}
    assert repr(read(json.dumps(whole).encode(), ("request", "prompts"))) == repr(whole)


@given(OBJECTS, LISTS, st.integers(0, 400), st.text('{}[],:"\\ \n\t0123456789-.eEtrufalsn', max_size=3), st.booleans())
@example({}, [], 0, "", True)
@example({}, [[1]], 12, ",", False)
def test_what_is_no_json_is_refused_in_the_words_of_json_at_its_place(
    others: dict[str, Any], items: list[Any], at: int, put: str, cut: bool
) -> None:
    text = json.dumps({**others, "items": items}, indent=1)
    at = min(at, len(text))
    body = (text[:at] + put + ("" if cut else text[at + 1 :])).encode()
    found = outcome(read, body)
    assert found == outcome(json.loads, body) or re.fullmatch("is given twice|gives .* twice", found, re.DOTALL)


@pytest.mark.parametrize(
    "body",
    [b"", b" \n", b"[1]", b'"a"', b"{", b'{"items"', b'{"items":', b'{"items": [', b'{"items": [1', b'{"items": [1,]}',
     b'{"items": [1] "a": 2}', b'{"a": 1,}', b'{"items": []} {}', b"{1: 2}", b'{"items": [tru', b'{"a": "b',
     b'\xef\xbb\xbf{"a": 1}', b'{"a": "\xff"}', b'{"items": ["a\xc3', b'{"items": ["\xc3\x28"]}',
     '{"items": [1], "a": "ü"}'.encode("utf-16"), b'{"items": [' + b"1" * 5000 + b"]}"],
)  # fmt: skip
def test_a_broken_body_is_told_as_json_tells_it(body: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "MAX_VALUE", 10_000)
    assert outcome(read, body) == outcome(json.loads, body)


@pytest.mark.parametrize(
    ("body", "where"),
    [(b'{"items": ["' + b"a" * 3000 + b'"]}', "items, element 1"),
     (b'{"items": [1, ' + b"[" * 900 + b"1," * 2000, "items, element 2"),
     (b'{"items": ["' + b"a" * 30_000, "items, element 1"),
     (b'{"name": "' + b"a" * 3000 + b'"}', "body"),
     (b"{" + b",".join(b'"%d": 1' % n for n in range(1000)) + b"}", "body")],
)  # fmt: skip
def test_a_value_that_is_far_too_long_is_refused(body: bytes, where: str) -> None:
    with pytest.raises(TooLarge) as refused:
        read(body)
    assert refused.value.where == where


def test_what_is_given_twice_and_a_list_nested_too_deeply_are_refused() -> None:
    with pytest.raises(InvalidInput, match="given twice"):
        read(b'{"items": [1], "items": [2]}')
    for body, where, said in (
        (b'{"name": "a", "items": [], "name": "b"}', "name", "is given twice"),
        (b'{"items": [{"prompt": "a"}, {"prompt": "a", "prompt": "b"}]}', "items, element 2", "gives 'prompt' twice"),
        (b'{"settings": {"fps": 20, "fps": 30}}', "body", "gives 'fps' twice"),
    ):
        with pytest.raises(InvalidInput) as refused:
            read(body)
        assert (refused.value.where, refused.value.message) == (where, said)
    with pytest.raises(InvalidInput, match="the body is nested too deeply"):
        read(b'{"items": [' + b"[" * 1500 + b"]" * 1500 + b"]}")


def test_a_list_over_the_limit_is_not_read_to_its_end_for_the_fields() -> None:
    document = Document(io.BytesIO(b'{"items": [1, 2, 3, 4, ?'), ("items",), limit=2)
    assert document.fields() == {}
    assert document.is_cut
