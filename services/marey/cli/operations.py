"""Options of the command line for operations on motions: those of the table, in the order in which they are given."""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from marey.cli.signatures import replace_parameter
from marey.core.errors import InvalidInput, MareyError
from marey.motion.edits.operation import value_of_text
from marey.motion.edits.table import OPERATIONS

Ops = Annotated[
    Path | None,
    typer.Option("--ops", metavar="FILE", help='Operations as JSON, such as [{"op": "trim", "from": 0.5}].'),
]
MOST = 2**20
"""Bytes of a file of operations."""
GIVEN = "marey.operations"
"""Key of the context: the options of operations with their values, in order."""
_PLACE = re.compile(r"\bops\.(?P<number>[0-9]{1,3})(\.(?P<parameter>\w+))?( \([a-z-]+\))?$")
"""Place of an operation in an error, counted from 0: `ops.0.factor`, `ops.1 (trim)`."""


class OperationsCommand(TyperCommand):
    """A command that keeps the order of the options of operations; the parser gives each option apart."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Note the options of operations, then parse."""
        ctx.meta[GIVEN] = [*_given(args)]
        return super().parse_args(ctx, args)


def with_operations(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of all operations in place of its `**operations`."""
    options: dict[str, tuple[Any, object]] = {
        option.strip("-").replace("-", "_") + "_": (
            Annotated[
                list[str] | None if metavar else bool,
                typer.Option(option, metavar=metavar or None, help=about, show_default=False),
            ],
            None if metavar else False,
        )
        for option, (metavar, about) in _options().items()
    }
    replace_parameter(command, "operations", options)
    return command


def operations_of(context: typer.Context) -> list[dict[str, Any]]:
    """Return the operations that were given on the command line, as in JSON.

    Raises:
        InvalidInput: a value of another form, or an option without an operation before it that has it.
    """
    found: list[dict[str, Any]] = []
    for option, value in context.meta[GIVEN]:
        operation = OPERATIONS.get(option.removeprefix("--"))
        if operation is None:
            _add(found, option, value)
            continue
        try:
            values = operation.values_of_text(value) if operation.metavar else {}
        except ValueError as error:
            raise InvalidInput(f"{value!r} is not {error}", where=option) from None
        found.append({"op": operation.name, **values})
    return found


def given_operations(context: typer.Context, file: Path | None) -> Any:
    """Return the operations of a command: those of its options, or those of a file of JSON.

    Raises:
        InvalidInput: both are given, or none, or a value of another form.
        NotFound, InvalidFile, TooLarge: of the file.
    """
    from marey.core.documents import parse_json
    from marey.motion.files import read_limited

    steps = operations_of(context)
    if file is not None:
        if steps:
            raise InvalidInput("cannot be combined with operations", where="--ops", hint="Write them into the file.")
        return parse_json(read_limited(file, MOST), str(file), unique=True)
    if not steps:
        raise InvalidInput(
            "no operation is given", hint=f"Name one, such as --loop; `{context.command_path} --help` lists them."
        )
    return steps


@contextmanager
def naming_operations(context: typer.Context, file: Path | None) -> Generator[None]:
    """Let the errors of the block name the option of the operation that they concern, or its number in the file."""
    try:
        yield
    except MareyError as error:
        found = None if error.where is None else _PLACE.search(error.where)
        if found is not None and error.where is not None:
            given = _option_of(context, found) if file is None else _place_in(file, found)
            error.where = error.where[: found.start()] + given
        raise


def _option_of(context: typer.Context, found: re.Match[str]) -> str:
    """Return the option of an operation with its value, or that of its parameter."""
    number, shown, own = -1, found.group(), set[str]()
    for option, value in context.meta[GIVEN]:
        operation = OPERATIONS.get(option.removeprefix("--"))
        number += operation is not None
        if number != int(found["number"]):
            continue
        if operation is not None:
            shown = f"{option} {value}".strip()
            own = {each.option for each in operation.parameters if each.option and each.name == found["parameter"]}
        elif option in own:
            return f"{option} {value}".strip()
    return shown


def _place_in(file: Path, found: re.Match[str]) -> str:
    parameter = "" if found["parameter"] is None else f", {found['parameter']}"
    return f"{file}: operation {int(found['number']) + 1}{parameter}"


def _add(found: Sequence[dict[str, Any]], option: str, value: str) -> None:
    """Set a parameter with an option of its own in the last operation that has it."""
    for row in reversed(found):
        for parameter in OPERATIONS[row["op"]].parameters:
            if parameter.option == option:
                row[parameter.name] = value_of_text(value) if parameter.metavar else True
                return
    having = [each.name for each in OPERATIONS.values() if option in {p.option for p in each.parameters}]
    raise InvalidInput(
        "belongs to no operation before it",
        where=option,
        hint=f"Write it after {' or '.join(f'--{name}' for name in having)}.",
    )


def _options() -> Mapping[str, tuple[str, str]]:
    """Return placeholder and help of each option: of operations, then of their parameters with options of their own."""
    own = {f"--{each.name}": (each.metavar, each.about) for each in OPERATIONS.values()}
    extra: dict[str, tuple[str, dict[str, list[str]]]] = {}
    for each in OPERATIONS.values():
        for parameter in each.parameters:
            if parameter.option:
                _, texts = extra.setdefault(parameter.option, (parameter.metavar, {}))
                texts.setdefault(parameter.about, []).append(f"--{each.name}")
    helps = {
        option: (metavar, " ".join(f"After {' or '.join(names)}: {about}" for about, names in texts.items()))
        for option, (metavar, texts) in extra.items()
    }
    return own | helps


def _given(args: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the options of operations in arguments, with their values; flags have an empty one."""
    options = _options()
    rest = iter(args)
    for argument in rest:
        if argument == "--":
            return
        option, assigned, value = argument.partition("=")
        if option in options:
            metavar, _ = options[option]
            yield option, value if assigned or not metavar else next(rest, "")
