"""Errors of pydantic in the words of this product."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from typing import Annotated, Any, Literal
from uuid import UUID

import pytest
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, field_validator

from marey.core.validation import first_problem, problem_of, worded


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")

    size: int

    @field_validator("size")
    @classmethod
    def _even(cls, value: int) -> int:
        if value % 2:
            raise ValueError("is odd")
        return value


WORDED = worded(r"^[a-z]{1,3}$", "one to three small letters")
LONG = "x" * 100


def said(kind: Any, value: object) -> str:
    with pytest.raises(ValidationError) as caught:
        TypeAdapter[Any](kind).validate_python(value)
    return first_problem(caught.value)


@pytest.mark.parametrize(
    ("kind", "value", "message"),
    [
        (int, "high", "'high' is not a whole number"),
        (int, 2.5, "2.5 is not a whole number"),
        (str, 10**100, "a number of over 40 digits is not a text"),
        (int, [1], "is a list, not a whole number"),
        (int, None, "is null, not a whole number"),
        (float, "x", "'x' is not a number"),
        (float, LONG, f"'{'x' * 40}' is not a number"),
        (Annotated[float, Field(allow_inf_nan=False)], "inf", "is not a finite number"),
        (bool, "maybe", "'maybe' is not true or false"),
        (bool, {}, "is an object, not true or false"),
        (str, 3, "3 is not a text"),
        (list[int], "a", "'a' is not a list"),
        (tuple[int, ...], 3, "3 is not a list"),
        (dict[str, int], [], "is a list, not an object"),
        (Inner, "a", "'a' is not an object"),
        (Inner, {}, "size: is missing"),
        (Inner, {"size": 3}, "size: is odd"),
        (Inner, {"size": 2, "sise": 2}, "sise: is not a known field"),
        (list[int], [1, "b"], "1: 'b' is not a whole number"),
        (Annotated[int, Field(ge=1)], 0, "0 is below 1, the least that is allowed"),
        (Annotated[int, Field(le=1000)], "1001", "1001 is above 1,000, the most that is allowed"),
        (Annotated[float, Field(gt=0)], 0, "0 is not above 0"),
        (Annotated[float, Field(lt=0.5)], 0.5, "0.5 is not below 0.5"),
        (Annotated[list[int], Field(min_length=1)], [], "is empty"),
        (Annotated[list[int], Field(min_length=2)], [], "is empty: at least 2 are needed"),
        (Annotated[list[int], Field(min_length=2)], [1], "has 1 element: at least 2 are needed"),
        (Annotated[list[int], Field(max_length=1)], [1, 2], "has 2 elements: at most 1 is allowed"),
        (Annotated[str, Field(min_length=1)], "", "is empty"),
        (Annotated[str, Field(min_length=2)], "a", "has 1 character: at least 2 are needed"),
        (Annotated[str, Field(max_length=2)], "abc", "has 3 characters: at most 2 are allowed"),
        (Annotated[str, Field(pattern=WORDED)], "Zoë", "'Zoë' cannot be used: allowed are one to three small letters"),
        (Annotated[str, Field(pattern="^b$")], "a", "'a' cannot be used"),
        (Literal["red", "blue"], "green", "'green' is not known; known: red, blue"),
        (Colour, "Blue", "'Blue' is not known (did you mean 'blue'?); known: red, blue"),
        (Literal[1, 2], 3, "3 is not known; known: 1 or 2"),
        (UUID, "walk", "'walk' is not an id such as 01234567-89ab-cdef-0123-456789abcdef"),
        (datetime, "today", "'today' is not a time such as 2026-11-27T10:00:00Z"),
        (AwareDatetime, "2026-11-27T10:00:00", "'2026-11-27T10:00:00' is not a time such as 2026-11-27T10:00:00Z"),
    ],
)
def test_each_usual_fault_has_words_of_our_own(kind: Any, value: object, message: str) -> None:
    assert said(kind, value) == message


def test_another_fault_keeps_the_words_of_pydantic_behind_the_value() -> None:
    assert said(Annotated[int, Field(multiple_of=3)], 4) == "4 cannot be used: it should be a multiple of 3"
    assert said(Annotated[float, Field(multiple_of=3)], [4]) == "is a list, not a number"


def test_an_unknown_field_is_told_with_those_beside_it() -> None:
    with pytest.raises(ValidationError) as caught:
        Inner.model_validate({"size": 2, "sise": 2})
    (error,) = caught.value.errors()
    assert problem_of(error, ("size", "name")) == ("is not a known field (did you mean 'size'?); known: size, name")


def test_a_value_is_not_quoted_where_that_is_not_wanted() -> None:
    with pytest.raises(ValidationError) as caught:
        Inner.model_validate({"size": "secret"})
    assert first_problem(caught.value, quoted=False) == "size: is not a whole number"
    with pytest.raises(ValidationError) as caught:
        TypeAdapter[Any](Annotated[int, Field(ge=3)]).validate_python(1)
    assert first_problem(caught.value, quoted=False) == "is below 3, the least that is allowed"
