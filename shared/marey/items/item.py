"""One line of input, and its only check.

The command line (files, `generate`) and the API (JSON and NDJSON bodies) read items with this module, so that
problems have the same words everywhere. Standard library only: the small client imports it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar, cast

from marey.core.documents import json_problem, unique_object
from marey.core.errors import InvalidInput, TooLarge
from marey.core.suggestions import did_you_mean
from marey.items.constraints import read_constraints
from marey.items.problems import MAX_PROBLEMS, InvalidItems, Problem
from marey.items.prompts import check_prompt
from marey.items.settings import check_settings, check_variety
from marey.items.timeline import read_timeline, timeline_seconds, timeline_text
from marey.items.values import (
    MAX_SEED,
    check_model,
    check_name,
    check_seconds,
    check_seed,
    check_string,
    check_tags,
    check_variants,
)

T = TypeVar("T")
Rows = Sequence[Mapping[str, Any]]
"""Objects of JSON."""

MAX_ITEMS = 100_000
"""Items (prompts times variants) of one job."""
MAX_BODY_BYTES = 64 * 2**20
MAX_UNKNOWN = 100
"""Unknown fields of one item that are reported one by one."""
MAX_SUGGESTED = 3
"""Unknown fields of one item for which a known one is suggested: a search takes microseconds, and items are many."""


@dataclass(frozen=True)
class ItemSpec:
    """The fields of an item that stay as they are from the request to the worker.

    Requests (`Item`), submitted items (`marey.jobs.NewItem`), rows (`ItemRow`) and claims (`ClaimedItem`) inherit them,
    and the columns of SQL statements are made from them.

    Attributes:
        prompt: the user's text; of a timeline its text form.
        name: of the motion; clients derive its file name from it.
        seconds: requested length; None = the model's estimate.
        tags: labels of the motion.
        timeline: prompts at stated times (`marey.items.timeline`); None = the prompt alone.
        constraints: what the motion keeps to (`marey.items.constraints`); None = nothing.
    """

    prompt: str
    name: str | None = None
    seconds: float | None = None
    tags: tuple[str, ...] = ()
    timeline: Rows | None = field(default=None, kw_only=True)
    constraints: Rows | None = field(default=None, kw_only=True)

    def spec(self) -> dict[str, Any]:
        """Return the fields of `ItemSpec` alone."""
        return {name: getattr(self, name) for name in SPEC_FIELDS}


SPEC_FIELDS = tuple(each.name for each in fields(ItemSpec))
JSON_FIELDS = frozenset({"timeline", "constraints"})
"""Fields of `ItemSpec` that are stored as JSON."""


@dataclass(frozen=True)
class Item(ItemSpec):
    """One prompt with its options; None = the server or the model decides."""

    seed: int | None = None
    """Seed of variant 0; variant k uses seed + k."""
    variants: int = 1
    model: str | None = None
    """A model (`hgm3`), a bundle (`hgm3-starter`) or an exact bundle (`hgm3-starter@0123456789ab`)."""
    settings: Mapping[str, float] = field(default_factory=dict[str, float])
    variety: str | None = None
    """One of `VARIETIES`; settings of the item override what the model makes of it."""

    def as_json(self) -> dict[str, Any]:
        """Return the item as a line of a request body, with the given fields only."""
        values = {name: getattr(self, name) for name in CHECKS}
        values["tags"] = list(self.tags)
        if self.timeline is not None:
            del values["prompt"]
        return {name: value for name, value in values.items() if value not in (None, [], {})}


@dataclass(frozen=True)
class Unreadable:
    """A line, or a part of it, that could not be parsed; `read_item` refuses it with this message."""

    message: str
    field: str | None = None


def read_json(line: str | bytes) -> object:
    """Parse the JSON value of one line, or return `Unreadable`, also where an object gives a key twice: JSON would keep
    the last, and the caller cannot have meant both."""
    try:
        return json.loads(line, object_pairs_hook=unique_object)
    except json.JSONDecodeError as error:  # which counts lines of its own
        return Unreadable(f"is not JSON: {error.msg} at character {error.pos + 1}")
    except (ValueError, RecursionError) as error:
        return Unreadable(json_problem(error))


def read_item(raw: object, line: int | None = None) -> tuple[Item | None, list[Problem]]:
    """Return the item in `raw`, a JSON object, or all its problems.

    Args:
        raw: value of a JSON line or an element of `items`, or `Unreadable`.
        line: line number, for the problems.
    """
    values, problems = read_values(raw, line)
    return (None, problems) if problems else (Item(**values), [])


def read_values(raw: object, line: int | None = None) -> tuple[dict[str, Any], list[Problem]]:
    """Return the usable fields of an item, and all its problems; see `read_item`."""
    values, problems = read_fields(raw, CHECKS, line)
    if "timeline" in values:
        problems += complete_timeline(values, line)
    seed, variants = values.get("seed"), values.get("variants", 1)
    if seed is not None and seed + variants - 1 > MAX_SEED:
        problems.append(Problem(line, "seed", f"plus {variants - 1} for the last variant is over {MAX_SEED}"))
    return values, problems


def complete_timeline(values: dict[str, Any], line: int | None) -> list[Problem]:
    """Give an item with a timeline its text form as the prompt, and check the fields that exclude one another."""
    problems: list[Problem] = []
    if "prompt" in values:
        problems.append(Problem(line, "prompt", "stands beside a timeline: give one of the two"))
    end, seconds = timeline_seconds(values["timeline"]), values.pop("seconds", None)
    if seconds not in (None, end):
        problems.append(Problem(line, "seconds", f"{seconds:g} is not the end of the timeline, {end:g}: leave it out"))
    values["prompt"] = timeline_text(values["timeline"])
    return problems


def names_model(values: Mapping[str, Any], problems: Iterable[Problem]) -> bool:
    """Return True if the model of an item is known, so that its other fields can be checked against the model's
    ranges."""
    return bool(values) and all(problem.field != "model" for problem in problems)


def read_fields(
    raw: object, checks: Mapping[str, Callable[[object], object]], line: int | None = None
) -> tuple[dict[str, Any], list[Problem]]:
    """Return the checked values of a JSON object that has a prompt, and all its problems.

    Args:
        raw: see `read_item`.
        checks: by known field; each returns the value, or raises `InvalidInput`.
        line: line number, for the problems.
    """
    if isinstance(raw, Unreadable):
        return {}, [Problem(line, raw.field, raw.message)]
    if not isinstance(raw, Mapping):
        return {}, [Problem(line, None, 'is not an object: write {"prompt": "…"}')]
    given = cast("Mapping[object, object]", raw)
    unknown = [name for name in given if name not in checks]
    known = ", ".join(checks)
    problems = [
        Problem(
            line,
            ascii(name)[1:41].strip("'"),
            f"is not a known field{did_you_mean(str(name), checks) if number < MAX_SUGGESTED else ''}; known: {known}",
        )
        for number, name in enumerate(unknown[:MAX_UNKNOWN])
    ]
    if len(unknown) > MAX_UNKNOWN:
        problems.append(Problem(line, None, f"has {len(unknown)} unknown fields; known: {known}"))
    values: dict[str, Any] = {}
    for name, check in checks.items():
        if given.get(name) is None:
            continue
        try:
            values[name] = check(given[name])
        except InvalidInput as error:
            where = error.where if error.where and error.where.startswith(f"{name}.") else name
            problems.append(Problem(line, where, error.on_a_line))
    if given.get("prompt") is None and (given.get("timeline") is None or "timeline" not in checks):
        problems.append(Problem(line, "prompt", "is missing: say what the person does"))
    return values, problems


def read_items(
    raws: Iterable[tuple[int | None, object]],
    *,
    where: str | None = None,
    check: Callable[[Mapping[str, Any], int | None], Iterable[Problem]] | None = None,
) -> Iterator[Item]:
    """Yield items while they are read, as `checked` does.

    Args:
        check: yields other problems of an item's usable fields; called if `names_model`.

    Raises:
        InvalidItems: at least one item is invalid.
        InvalidInput: there are no items.
        TooLarge: more than `MAX_ITEMS`, counting variants.
    """
    count = 0

    def read(raw: object, line: int | None) -> tuple[Item | None, list[Problem]]:
        nonlocal count
        values, problems = read_values(raw, line)
        if check is not None and names_model(values, problems):
            problems += check(values, line)
        item = None if problems else Item(**values)
        count += 1 if item is None else item.variants
        check_count(count, line, where)
        return item, problems

    return checked(raws, read, where=where)


def check_count(count: int, line: int | None, where: str | None) -> None:
    """Validate the number of motions of a job; reading stops far above the limit.

    Raises:
        TooLarge: the number is over the limit.
    """
    if count > MAX_ITEMS:
        raise TooLarge(
            f"is over the limit of {MAX_ITEMS:,} motions (prompts times variants) a job",
            where=where if line is None else ", ".join(filter(None, (where, f"line {line}"))),
            hint="Submit them as several jobs.",
        )


def checked(
    raws: Iterable[tuple[int | None, object]],
    read: Callable[[object, int | None], tuple[T | None, list[Problem]]],
    *,
    where: str | None = None,
) -> Iterator[T]:
    """Yield the results of `read` one by one; after the last, raise one error with all problems. Earlier results are
    valid only if no error follows.

    Raises:
        InvalidItems: at least one item is invalid.
        InvalidInput: there are no items.
    """
    problems: list[Problem] = []
    good = total = 0
    for line, raw in raws:
        value, found = read(raw, line)
        total += len(found)
        problems.extend(found[: MAX_PROBLEMS - len(problems)])
        if value is not None and not problems:
            good += 1
            yield value
    if problems:
        raise InvalidItems(problems, where=where, total=total)
    if not good:
        raise InvalidInput("there are no prompts", where=where, hint="Give at least one prompt.")


def _prompt(value: object) -> str:
    return check_prompt(check_string(value))


CHECKS: dict[str, Callable[[object], object]] = {
    "prompt": _prompt,
    "name": check_name,
    "seconds": check_seconds,
    "seed": check_seed,
    "variants": check_variants,
    "model": check_model,
    "tags": check_tags,
    "settings": check_settings,
    "variety": check_variety,
    "timeline": read_timeline,
    "constraints": read_constraints,
}
"""Check of each field's value, in the order of columns."""
COLUMNS = tuple(CHECKS)
"""Of tables of prompts; a cell of `constraints` holds JSON."""
