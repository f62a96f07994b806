"""One line of input, and its only check.

The command line (files, `generate`) and the API (JSON and NDJSON bodies) read items with this module, so that
problems have the same words everywhere. Standard library only: the small client imports it.
"""

from __future__ import annotations

import json
import math
import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar, cast

from marey.core.characters import check_text, is_printable
from marey.core.errors import InvalidInput, TooLarge
from marey.items.constraints import read_constraints
from marey.items.prompts import check_prompt
from marey.items.timeline import read_timeline, timeline_seconds, timeline_text

T = TypeVar("T")
Rows = Sequence[Mapping[str, Any]]
"""Objects of JSON."""

MAX_ITEMS = 100_000
"""Items (prompts times variants) of one job."""
MAX_BODY_BYTES = 64 * 2**20
MAX_PROBLEMS = 1000
"""Problems beyond this number are counted, not listed."""
MAX_UNKNOWN = 100
"""Unknown fields of one item that are reported one by one."""
MAX_SEED = 2**31 - 1
MAX_VARIANTS = 100
MIN_SECONDS, MAX_SECONDS = 0.5, 60.0
"""Range over all models; a bundle's own range, which is narrower, is checked once the bundle is known."""
MAX_TAGS, MAX_TAG_LENGTH = 20, 64

OUTPUT_FPS, BEST_OF, REDRAWS = "fps", "best_of", "redraws"
"""Settings of an item that are not the network's: the frame rate of its files, the candidates of which the best one
becomes its motion, and the most further rounds of candidates while none is good."""
MIN_OUTPUT_FPS, MAX_OUTPUT_FPS = 1.0, 240.0
MAX_BEST_OF, MAX_REDRAWS = 8, 2
VARIETIES = ("low", "normal", "high")
"""Levels of how much motions of one prompt differ; a model maps them to its settings, `normal` to none."""
PLATFORM_SETTINGS: Mapping[str, tuple[float, float]] = {
    OUTPUT_FPS: (MIN_OUTPUT_FPS, MAX_OUTPUT_FPS),
    BEST_OF: (1, MAX_BEST_OF),
    REDRAWS: (0, MAX_REDRAWS),
}
"""The range of each. All but the frame rate are whole numbers."""
SETTING = re.compile(r"[a-z][a-z0-9_]{0,39}")
"""Names of settings. The spec of a model (`marey.registry`) defines its settings and their ranges: they are checked
where the model is known."""
MAX_SETTINGS = 32
MAX_SETTING = 1e9
"""Limit on the absolute value of any setting."""
SETTINGS_SEPARATOR = ";"

MAX_NAME = 100
NAME = re.compile(rf"[^\W_][^/\\]{{0,{MAX_NAME - 1}}}")
"""A name begins with a letter or digit of any script and holds no separators and no invisible characters. The client
derives the file name from it (`marey.client.names`)."""
RESERVED = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|com[\d¹²³]|lpt[\d¹²³])( *\..*)?", re.IGNORECASE)
"""Reserved device names of Windows."""
MODEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}(@[0-9a-f]{6,64})?")


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
class Problem:
    """One problem of the input. `line` counts from 1; None = it concerns no line."""

    line: int | None
    field: str | None
    message: str

    def __str__(self) -> str:
        place = ": ".join(str(p) for p in (f"line {self.line}" if self.line else None, self.field) if p is not None)
        return f"{place}: {self.message}" if place else self.message


class InvalidItems(InvalidInput):
    """Input with unusable lines; none of it was used."""

    problem_type = "invalid-items"

    def __init__(
        self,
        problems: Iterable[Problem],
        *,
        where: str | None = None,
        total: int | None = None,
        hint: str = "Correct them and try again.",
        argument: str | None = None,
    ) -> None:
        found = list(problems)
        self.total = len(found) if total is None else total
        self.problems = tuple(found[:MAX_PROBLEMS])
        count = "1 problem" if self.total == 1 else f"{self.total} problems"
        super().__init__(f"{count} in the input; none of it is used", where=where, hint=hint, argument=argument)

    def __str__(self) -> str:
        lines = [f"  {problem}" for problem in self.problems]
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


@dataclass(frozen=True)
class Unreadable:
    """A line, or a part of it, that could not be parsed; `read_item` refuses it with this message."""

    message: str
    field: str | None = None


def read_json(line: str | bytes) -> object:
    """Parse the JSON value of one line, or return `Unreadable`."""
    try:
        return json.loads(line)
    except RecursionError:
        return Unreadable("is nested too deeply")
    except ValueError as error:
        return Unreadable(f"is not JSON: {error}")


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
        Problem(line, ascii(name)[1:41].strip("'"), f"is not a known field; known: {known}")
        for name in unknown[:MAX_UNKNOWN]
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


def _name(value: object) -> str:
    text = check_text(_text(value))
    if not text.isascii():
        text = re.sub(r"[^\S ]", " ", unicodedata.normalize("NFC", text))
    text = text.strip()
    if len(text) > MAX_NAME:
        raise InvalidInput(f"has {len(text)} characters; file names take up to {MAX_NAME} of it")
    if RESERVED.fullmatch(text):
        raise InvalidInput(f"{text!r} cannot be a file name: it is a device name on Windows")
    if not NAME.fullmatch(text) or text.endswith(".") or ".." in text or not is_printable(text):
        raise InvalidInput(
            f"{text[:60]!r} cannot be a file name: begin with a letter or digit, use no / \\ .. and no dot at the end"
        )
    return text


def _seconds(value: object) -> float:
    number = _number(value)
    if not MIN_SECONDS <= number <= MAX_SECONDS:
        raise InvalidInput(f"{number:g} is outside {MIN_SECONDS:g} to {MAX_SECONDS:g} seconds")
    return number


def outside_range(seconds: float, low: float, high: float, bundle: str) -> str:
    """Return the message about a length that a bundle cannot generate."""
    return f"{seconds:g} is outside {low:g} to {high:g} seconds, the range of {bundle}"


def _seed(value: object) -> int:
    return _whole(value, 0, MAX_SEED)


def _variants(value: object) -> int:
    return _whole(value, 1, MAX_VARIANTS)


def _model(value: object) -> str:
    text = _text(value)
    if not MODEL.fullmatch(text):
        raise InvalidInput(f"{text[:60]!r} is not the name of a model or bundle: `marey models list` shows them")
    return text


def _tags(value: object) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        raise InvalidInput('is not a list of words: write ["walk", "take 2"]')
    given = cast("Sequence[object]", value)
    if len(given) > MAX_TAGS:
        raise InvalidInput(f"{len(given)} tags are over the limit of {MAX_TAGS}")
    return tuple(_tag(tag) for tag in given)


def _tag(value: object) -> str:
    tag = _text(value)
    if not tag.isprintable():
        check_text(tag, subject=f"{tag[:80]!r} is not a tag: it")
    if not tag.strip() or len(tag) > MAX_TAG_LENGTH or not is_printable(tag):
        raise InvalidInput(f"{tag[:80]!r} is not a tag: 1 to {MAX_TAG_LENGTH} printable characters")
    return tag


def _settings(value: object) -> dict[str, float]:
    if not isinstance(value, Mapping):
        if isinstance(value, str):  # of a table
            raise InvalidInput(f"{value[:60]!r} is not settings: write guidance=4.5;temperature=0.8")
        raise InvalidInput('is not an object: write {"guidance": 4.5}')
    given = cast("Mapping[object, object]", value)
    if len(given) > MAX_SETTINGS:
        raise InvalidInput(f"{len(given)} settings are over the limit of {MAX_SETTINGS}")
    checked: dict[str, float] = {}
    for name, number in given.items():
        if not isinstance(name, str) or not SETTING.fullmatch(name):
            raise InvalidInput(f"{str(name)[:60]!r} is not the name of a setting, such as guidance")
        low, high = PLATFORM_SETTINGS.get(name, (-MAX_SETTING, MAX_SETTING))
        try:
            checked[name] = _whole(number, int(low), int(high)) if name in (BEST_OF, REDRAWS) else _number(number)
        except InvalidInput as error:
            raise InvalidInput(f"{name}: {error.message}") from error
        if not low <= checked[name] <= high:
            raise InvalidInput(f"{name}: {checked[name]:g} is outside {low:g} to {high:g}")
    return checked


def _variety(value: object) -> str:
    text = _text(value)
    if text not in VARIETIES:
        raise InvalidInput(f"unknown variety {text[:40]!r}; known: {', '.join(VARIETIES)}")
    return text


def read_setting(text: str) -> tuple[str, float]:
    """Read `NAME=VALUE`, as `guidance=4.5`.

    Raises:
        InvalidInput: it is something else.
    """
    name, _, value = (part.strip() for part in text.partition("="))
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not SETTING.fullmatch(name) or not math.isfinite(number):
        raise InvalidInput(f"{text[:60]!r} is not a setting: write NAME=VALUE, such as guidance=4.5")
    return name, number


def read_settings(text: str) -> dict[str, float]:
    """Read settings in one cell of a table: `temperature=1.2;guidance=4`.

    Raises:
        InvalidInput: it is something else, or names a setting twice.
    """
    found: dict[str, float] = {}
    for part in filter(None, (part.strip() for part in text.split(SETTINGS_SEPARATOR))):
        name, value = read_setting(part)
        if name in found:
            raise InvalidInput(f"{name} stands twice")
        found[name] = value
    return found


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise InvalidInput(f"is {_kind(value)}, not a text")
    return value


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidInput(f"is {_kind(value)}, not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InvalidInput("is not a finite number")
    return number


def _whole(value: object, low: int, high: int) -> int:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise InvalidInput(f"is {_kind(value)}, not a whole number")
    if not low <= value <= high:
        raise InvalidInput(f"{value if abs(value) < 10**20 else 'it'} is outside {low} to {high}")
    return value


def _kind(value: object) -> str:
    if isinstance(value, str):
        return repr(value[:40])
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, list):
        return "a list"
    return "an object" if isinstance(value, dict) else ascii(value)[:40]


def _prompt(value: object) -> str:
    return check_prompt(_text(value))


CHECKS: dict[str, Callable[[object], object]] = {
    "prompt": _prompt,
    "name": _name,
    "seconds": _seconds,
    "seed": _seed,
    "variants": _variants,
    "model": _model,
    "tags": _tags,
    "settings": _settings,
    "variety": _variety,
    "timeline": read_timeline,
    "constraints": read_constraints,
}
"""Check of each field's value, in the order of columns."""
COLUMNS = tuple(CHECKS)
"""Of tables of prompts; a cell of `constraints` holds JSON."""
