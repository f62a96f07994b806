"""Reading of operations from JSON. Standard library only: the small client imports it.

[{"op": "trim", "from": 0.5, "to": "f60"}, {"op": "loop"}, {"op": "in-place"}]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from marey.core.errors import InvalidInput, TooLarge
from marey.motion.edits.operation import REQUIRED, Operation, Parameter
from marey.motion.edits.table import OPERATIONS

MOST = 32
"""Operations of one edit."""
MOST_PIECES = 32
"""Motions that one edit makes of a motion; each split doubles them."""


@dataclass(frozen=True)
class Step:
    """An operation with its values, checked.

    Attributes:
        operation: of the table.
        values: of every parameter, by name.
        where: its place in the request, for errors.
        asked: name of the operation in the request, where that differs: a split becomes trims. Empty = the same.
    """

    operation: Operation
    values: Mapping[str, Any]
    where: str
    asked: str = ""

    @property
    def named(self) -> str:
        """Return the place with the name of the operation in the request, as `ops.0 (trim)`."""
        return f"{self.where} ({self.asked or self.operation.name})"

    def as_json(self) -> dict[str, Any]:
        """Return the step as it stands in requests and manifests."""
        return {"op": self.operation.name, **{name: value for name, value in self.values.items() if value is not None}}


def read_steps(ops: object, *, where: str = "ops") -> tuple[Step, ...]:
    """Check operations.

    Args:
        ops: a list of objects such as `{"op": "trim", "from": 0.5}`.
        where: name of the list in errors.

    Raises:
        InvalidInput: something else than a list of 1 to `MOST` known operations with their parameters.
    """
    if not isinstance(ops, Sequence) or isinstance(ops, str | bytes):
        raise InvalidInput("is not a list of operations", where=where, hint='Example: [{"op": "mirror"}].')
    rows = cast("Sequence[object]", ops)
    if not 1 <= len(rows) <= MOST:
        raise InvalidInput(f"{len(rows)} operations; allowed: 1 to {MOST}", where=where)
    return tuple(_read(row, f"{where}.{number}") for number, row in enumerate(rows))


def prompts_of_steps(steps: Sequence[Step]) -> list[str]:
    """Return the prompts that a model reads, in the order of the steps that have one of their own."""
    return [step.values["prompt"] for step in steps if step.operation.needs_model and step.values.get("prompt")]


def pieces_of(steps: Sequence[Step]) -> tuple[tuple[Step, ...], ...]:
    """Return the operations of each resulting motion: one list, or two for each split, which becomes two trims.

    Raises:
        TooLarge: more than `MOST_PIECES` pieces.
    """
    splits = [step for step in steps if step.operation.pieces]
    if 2 ** len(splits) > MOST_PIECES:
        raise TooLarge(
            f"{len(splits)} splits make {2 ** len(splits)} pieces; the most is {MOST_PIECES}",
            where=splits[-1].where,
            hint="Trim the pieces one by one, or split them in several edits.",
        )
    for index, step in enumerate(steps):
        if step.operation.pieces:
            at = step.values["at"]
            cuts = ({"from": 0.0, "to": at}, {"from": at, "to": None})
            trims = (Step(OPERATIONS["trim"], values, step.where, step.operation.name) for values in cuts)
            return tuple(piece for trim in trims for piece in pieces_of([*steps[:index], trim, *steps[index + 1 :]]))
    return (merged(steps),)


def merged(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Return the steps with neighbouring changes of speed as one, so that frames are computed once."""
    result: list[Step] = []
    for step in steps:
        last = result[-1] if result else None
        if last is not None and step.operation.name == last.operation.name == "speed":
            factor = last.values["factor"] * step.values["factor"]
            result[-1] = Step(step.operation, {"factor": factor}, step.where)
        else:
            result.append(step)
    return tuple(result)


def _read(row: object, where: str) -> Step:
    if not isinstance(row, Mapping):
        raise InvalidInput("is not an object", where=where, hint='Example: {"op": "mirror"}.')
    given = dict(cast("Mapping[str, Any]", row))
    operation = OPERATIONS.get(str(given.pop("op", "")))
    if operation is None:
        raise InvalidInput("unknown operation", where=f"{where}.op", hint=f"Known: {', '.join(OPERATIONS)}.")
    known = {each.name: each for each in operation.parameters}
    if unknown := [str(name) for name in given if name not in known]:
        hint = f"Known: {', '.join(known)}." if known else f"{operation.name} has none."
        raise InvalidInput(f"unknown parameter {unknown[0]!r:.80} of {operation.name}", where=where, hint=hint)
    values = {name: _value(each, given.get(name), where) for name, each in known.items()}
    _check_range(values.get("from"), values.get("to"), where)
    return Step(operation, values, where)


def _check_range(begin: object, end: object, where: str) -> None:
    """Check that a range does not end before it begins, as far as both moments are of one kind: seconds, or frames."""
    if isinstance(begin, str) and isinstance(end, str):
        is_backward = int(end.removeprefix("f")) < int(begin.removeprefix("f"))
    else:
        is_backward = isinstance(begin, int | float) and isinstance(end, int | float) and end < begin
    if is_backward:
        raise InvalidInput(f"the end, {_named(end)}, is before the beginning, {_named(begin)}", where=f"{where}.to")


def _named(moment: object) -> str:
    return f"frame {moment.removeprefix('f')}" if isinstance(moment, str) else f"{moment:g} s"


def _value(parameter: Parameter, value: Any, where: str) -> Any:
    if value is None:
        if parameter.default is REQUIRED:
            raise InvalidInput("is missing", where=f"{where}.{parameter.name}", hint=parameter.about)
        return parameter.default
    try:
        return parameter.read(value)
    except ValueError as error:
        raise InvalidInput(f"{value!r:.80} is not {error}", where=f"{where}.{parameter.name}") from None
