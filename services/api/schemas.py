"""Envelopes that every noun shares."""

from __future__ import annotations

from typing import Annotated, Generic, TypeVar

from fastapi import Header, Query
from pydantic import BaseModel, ConfigDict, Field

Row = TypeVar("Row")

Limit = Annotated[int, Query(ge=1, le=1000, description="Elements of a page, at most.")]
Cursor = Annotated[str | None, Query(max_length=500, description="`next` of the page before.")]

IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        pattern=r"^[\x21-\x7e]+$",
        description="The same key and body within 24 hours give what the first one made; another body is refused.",
    ),
]


class View(BaseModel):
    """Part of an answer."""

    model_config = ConfigDict(frozen=True)


class PageView(View, Generic[Row]):
    """A page of a listing."""

    items: list[Row]
    next: str | None = Field(description="Cursor of the next page; null at the end.")
