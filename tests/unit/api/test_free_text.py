"""Every text that a request may hold is checked for control characters, by the types that the OpenAPI shows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from marey.core.characters import LINE_PATTERN, TEXT_PATTERN
from marey.http.schemas import MAX_COMMENT, MAX_NAME, Comment, Name, Reason
from tests.support.document import openapi

READ_BY_HAND = {
    "NewItemBody": {"prompt", "tags", "name", "model", "timeline", "constraints"},  # marey.items.item
    "TimelineRowBody": {"prompt"},  # marey.items.timeline
    "NewEditBody": {"model", "ops"},  # a bundle is found by it; marey.motion.edits.steps
    "EvaluationPromptBody": {"prompt", "expected", "timeline", "constraints"},  # marey.items.evaluation_prompts
    "NewStreamBody": {"prompt", "name", "model"},  # marey.items.item
    "ParseBody": {"prompts"},  # marey.items.prompts
}
NOT_STORED = {"cursor", "reference", "Range", "If-Range", "If-None-Match", "Last-Event-ID"}
"""Parsed into something else, or only compared."""


def unchecked(schema: dict[str, Any], components: dict[str, Any], path: str) -> Iterator[str]:
    """Where a schema lets any text in."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        for field, inner in components[name].get("properties", {}).items():
            if field not in READ_BY_HAND.get(name, ()):
                yield from unchecked(inner, components, f"{path}.{name}.{field}")
        return
    for inner in (*schema.get("anyOf", ()), *schema.get("allOf", ()), *filter(None, [schema.get("items")])):
        yield from unchecked(inner, components, path)
    free = schema.get("type") == "string" and not {"enum", "const", "pattern", "format"} & schema.keys()
    if free:
        yield path


def test_no_operation_takes_text_that_nobody_checks() -> None:
    document = openapi()
    components = document["components"]["schemas"]
    found: list[str] = []
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            place = f"{method} {path}"
            for content in operation.get("requestBody", {}).get("content", {}).values():
                found += unchecked(content["schema"], components, place)
            for parameter in operation.get("parameters", ()):
                if parameter["name"] not in NOT_STORED:
                    found += unchecked(parameter["schema"], components, f"{place}?{parameter['name']}")
    assert found == []


@pytest.mark.parametrize("kind", [Name, Comment, Reason])
@pytest.mark.parametrize("text", ["a\x1b[2J", "\x9b", "\x7f", "\u202e", "\u2066", "\0", "a\x0b", "\r"])
def test_control_characters_are_refused_with_their_number(kind: Any, text: str) -> None:
    with pytest.raises(ValidationError, match=r"U\+|NUL"):
        TypeAdapter(kind).validate_python(text)


def test_comments_may_hold_lines_and_names_may_not() -> None:
    assert TypeAdapter(Comment).validate_python("a\r\n\tb\u200d") == "a\n\tb\u200d"
    with pytest.raises(ValidationError, match=r"U\+000A"):
        TypeAdapter(Name).validate_python("a\nb")
    for kind, size in ((Name, MAX_NAME), (Comment, MAX_COMMENT)):
        TypeAdapter(kind).validate_python("x" * size)
        with pytest.raises(ValidationError, match="at most"):
            TypeAdapter(kind).validate_python("x" * (size + 1))


def test_the_openapi_tells_the_characters() -> None:
    assert TypeAdapter(Name).json_schema()["pattern"] == LINE_PATTERN
    assert TypeAdapter(Comment).json_schema()["pattern"] == TEXT_PATTERN
