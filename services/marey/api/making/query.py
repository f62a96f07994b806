"""Query parameters of a file made on request, from the options that exporters have: a new option needs no edit here."""

from __future__ import annotations

import inspect
import re
import types
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import Field, fields
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from fastapi import Depends, Query
from pydantic import Field as Bounds

from marey.core.errors import InvalidInput
from marey.http.schemas import FreeText
from marey.items.settings import MAX_OUTPUT_FPS, MIN_OUTPUT_FPS
from marey.motion.export_options import ExportOptions


def is_closed(kind: Any) -> bool:
    """Return True if a type has a few fixed values: bool, Literal, or such a type or None.

    A text may name a file, which would be one of the server's.
    """
    if get_origin(kind) in (Union, types.UnionType):
        return all(each is types.NoneType or is_closed(each) for each in get_args(kind))
    return kind is bool or get_origin(kind) is Literal


def query_options() -> dict[str, tuple[Any, Field[Any]]]:
    """Return type and field of each option that a request may set, by name."""
    kinds = get_type_hints(ExportOptions)
    return {each.name: (kinds[each.name], each) for each in fields(ExportOptions) if is_closed(kinds[each.name])}


def export_options(given: Mapping[str, Any]) -> ExportOptions:
    """Return the options of a request.

    Raises:
        InvalidInput: two contradict each other.
    """
    try:
        return ExportOptions(**given)
    except InvalidInput as error:
        error.where = error.argument or error.where
        raise


def _descriptions() -> dict[str, str]:
    """Return the descriptions of options in the docstring of `ExportOptions`."""
    _, _, attributes = (inspect.getdoc(ExportOptions) or "").partition("Attributes:\n")
    entries = re.findall(r"^    (\w+): (.+?)(?=^    \w|^$|\Z)", attributes, re.MULTILINE | re.DOTALL)
    return {name: " ".join(text.split()) for name, text in entries}


def _reader() -> Callable[..., Awaitable[Mapping[str, Any]]]:
    """Return a dependency with a parameter for each option; it checks no more than their types: the key comes first."""

    async def read(**given: Any) -> Mapping[str, Any]:  # async: needs no thread
        return given

    described = _descriptions()
    read.__signature__ = inspect.Signature(  # pyright: ignore[reportFunctionMemberAccess]
        [
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=option.default,
                annotation=Annotated[kind, Query(description=described.get(name))],
            )
            for name, (kind, option) in query_options().items()
        ]
    )
    return read


GivenOptions = Annotated[Mapping[str, Any], Depends(_reader())]
WantedRig = Annotated[
    Annotated[str, Bounds(min_length=1, max_length=63), FreeText()] | None,
    Query(description="Put the motion on a rig: one of `GET /v1/rigs`, or `mixamo`, `ue4`, `humanik`."),
]
WantedBody = Annotated[
    Annotated[str, Bounds(min_length=1, max_length=63), FreeText()] | None,
    Query(
        description="Give the motion the proportions of a rig: one of `GET /v1/rigs`, or `mixamo`, `ue4`, `humanik`; "
        "`standard` = Marey's own. In every format; not together with `rig`, which has proportions of its own."
    ),
]
Rate = Annotated[
    float | None,
    Query(
        ge=MIN_OUTPUT_FPS,
        le=MAX_OUTPUT_FPS,
        allow_inf_nan=False,
        description="Frames a second; none given = the motion's.",
    ),
]
