"""Signatures of commands that are put together from tables: typer reads them for options and help."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any


def replace_parameter(command: Callable[..., None], name: str, options: Mapping[str, tuple[Any, object]]) -> None:
    """Put options into the signature of a command in place of one of its parameters.

    Args:
        command: receives the options as arguments.
        name: of the parameter; `**options` of that name is one too.
        options: annotation and default of each, by the name of its argument.
    """
    signature = inspect.signature(command, eval_str=True)
    kind = signature.parameters[name].kind
    kind = inspect.Parameter.KEYWORD_ONLY if kind is inspect.Parameter.VAR_KEYWORD else kind
    added = [
        inspect.Parameter(option, kind, default=default, annotation=annotation)
        for option, (annotation, default) in options.items()
    ]
    parameters = [
        each
        for parameter in signature.parameters.values()
        for each in (added if parameter.name == name else [parameter])
    ]
    command.__signature__ = signature.replace(parameters=parameters)  # pyright: ignore[reportFunctionMemberAccess]
