"""Schemas that all nouns share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Generic, Self, TypeVar, get_args

from fastapi import Header, Query
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationInfo,
    field_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from marey.core.characters import LINE_PATTERN, LINES, TEXT_PATTERN, check_text, normalize_newlines
from marey.core.errors import InvalidInput
from marey.core.validation import worded

if TYPE_CHECKING:
    from marey.db.pages import Page  # it would import the database

Row = TypeVar("Row")
Stored = TypeVar("Stored")

MAX_NAME, MAX_COMMENT, MAX_REASON = 200, 2000, 500


@dataclass(frozen=True)
class FreeText:
    """Annotation of free text in a request, for `Annotated`; `marey.core.characters` has the rules.

    Attributes:
        lines: it may hold newlines and tabs.
    """

    lines: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(schema), "pattern": TEXT_PATTERN if self.lines else LINE_PATTERN}

    def _check(self, text: str) -> str:
        try:
            return check_text(normalize_newlines(text), allowed=LINES) if self.lines else check_text(text)
        except InvalidInput as error:
            raise PydanticCustomError("text", "{message}", {"message": error.message}) from error


Name = Annotated[str, Field(max_length=MAX_NAME), FreeText()]
"""Name of a job, evaluation, schedule or webhook."""
Comment = Annotated[str, Field(max_length=MAX_COMMENT), FreeText(lines=True)]
Reason = Annotated[str, Field(max_length=MAX_REASON), FreeText(lines=True)]

Limit = Annotated[int, Query(ge=1, le=1000, description="Elements of a page, at most.")]
Cursor = Annotated[str | None, Query(max_length=500, description="`next` of the page before.")]

IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        pattern=worded(r"^[\x21-\x7e]+$", "letters, digits and signs of ASCII, no spaces"),
        description="The same key and body within 24 hours return the first result; another body is refused.",
    ),
]


class JsonBody(BaseModel):
    """Body, or part of one, in JSON: a text, true and false are no numbers there, as they are in a query."""

    model_config = ConfigDict(extra="forbid")

    @field_validator("*", mode="before")
    @classmethod
    def _is_number(cls, value: object, info: ValidationInfo) -> object:
        if not isinstance(value, bool | str):
            return value
        annotation = cls.model_fields[str(info.field_name)].annotation
        kinds = {*(get_args(annotation) or (annotation,))} - {type(None)}
        if kinds and kinds <= {int, float}:
            raise PydanticCustomError("int_type" if kinds == {int} else "float_type", "not a number")
        return value


class View(BaseModel):
    """Part of an answer."""

    model_config = ConfigDict(frozen=True)


class PageView(View, Generic[Row]):
    """A page of a listing."""

    items: list[Row]
    next: str | None = Field(description="Cursor of the next page; null at the end.")

    @classmethod
    def of(cls, page: Page[Stored], view: Callable[[Stored], Row]) -> Self:
        """Return a page of rows as clients see them."""
        return cls(items=[view(row) for row in page.rows], next=page.cursor)
