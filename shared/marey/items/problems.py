"""Problems of input, and the errors that list them. Standard library only: the small client imports it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from marey.core.errors import InvalidInput

MAX_PROBLEMS = 1000
"""Problems beyond this number are counted, not listed."""


@dataclass(frozen=True)
class Problem:
    """One problem of the input. `line` counts from 1; None = it concerns no line."""

    line: int | None
    field: str | None
    message: str

    def __str__(self) -> str:
        return self.counted("line")

    def counted(self, unit: str) -> str:
        """Return the problem with the number of its line, which is called `unit`."""
        place = ": ".join(str(p) for p in (f"{unit} {self.line}" if self.line else None, self.field) if p is not None)
        return f"{place}: {self.message}" if place else self.message


class InvalidItems(InvalidInput):
    """Input with unusable lines; none of it was used.

    Args:
        unit: name of a line in messages: input that is no file has arguments or rows.
    """

    problem_type = "invalid-items"

    def __init__(
        self,
        problems: Iterable[Problem],
        *,
        where: str | None = None,
        total: int | None = None,
        hint: str = "Correct them and try again.",
        argument: str | None = None,
        unit: str = "line",
    ) -> None:
        self.unit = unit
        found = list(problems)
        self.total = len(found) if total is None else total
        self.problems = tuple(found[:MAX_PROBLEMS])
        count = "1 problem" if self.total == 1 else f"{self.total} problems"
        super().__init__(f"{count} in the input; none of it is used", where=where, hint=hint, argument=argument)

    def __str__(self) -> str:
        lines = [f"  {problem.counted(self.unit)}" for problem in self.problems]
        if self.total > len(lines):
            lines.append(f"  … and {self.total - len(lines)} more")
        head = f"{self.where}: {self.message}" if self.where else self.message
        return "\n".join([head, *lines, f"  {self.hint}"])


class OutOfScope(InvalidItems):
    """Prompts with actions that the model does not know, refused as the caller asked; none of the input was used."""

    problem_type = "out-of-scope"


class UnknownAction(InvalidInput):
    """One prompt with an action that the model does not know, refused as the caller asked."""

    problem_type = OutOfScope.problem_type
