"""Preparation of a submit before the database: parse the body, fix bundles and seeds, hash."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, BinaryIO, TypeVar

from pydantic import BaseModel, ValidationError

from marey.api.catalogue import Catalogue
from marey.api.documents import MAX_VALUE, Document
from marey.api.jobs.poses import NamedPoses, Poses, check_terms, posed
from marey.api.jobs.schemas import JobFields, JsonJobFields, NewJobBody
from marey.bundles import Bundle
from marey.bundles.scope import refuse_unknown
from marey.core.errors import InvalidInput, MareyError, TooLarge
from marey.core.validation import place_of, problem_of
from marey.http.problems import known_fields
from marey.items.item import Item, read_item, read_items, read_json
from marey.items.problems import InvalidItems, Problem
from marey.items.timeline import prompts_with_rows
from marey.jobs import NewItem
from marey.jobs.generators import GeneratorCapabilities, new_items
from marey.vocabulary.report import ScopeReport
from marey.vocabulary.scope import Scope

Fields = TypeVar("Fields", bound=BaseModel)
MAX_MODELS = 100
"""Maximum distinct models in one body: each is looked up on disk."""
MAX_LINES = 1_000_000
"""Maximum lines of NDJSON, including blank ones."""
LENGTH_FIELDS = ("prompt", "seconds", "timeline", "settings", "constraints")
"""Fields of an item that decide the length of its motion, and what is to fit it."""
Raws = Callable[[], Iterator[tuple[int, object]]]
"""Function that yields the items of a body with their lines, from its beginning at each call."""


@dataclass(frozen=True)
class Submission:
    """A checked request body."""

    fields: JobFields
    count: int
    """Number of motions."""
    by_bundle: Counter[tuple[str, str]]
    """Number of motions by model and exact bundle."""
    _raws: Raws
    _generators: Mapping[str | None, GeneratorCapabilities]
    """Generator capabilities by the item's model name."""
    named: NamedPoses
    """Frames of stored motions that constraints name."""
    _poses: Poses = field(default_factory=dict[Any, Any])

    def with_poses(self, poses: Poses) -> Submission:
        """Return the submission with the poses that its constraints name; its items need them.

        Raises:
            InvalidItems: no licence satisfies the terms of a pose and of the bundle.
        """
        problems: list[Problem] = []
        for item in self.named.items if poses else ():
            try:
                check_terms(item, poses, self._generators[item.model].bundle.manifest.licence)
            except InvalidInput as error:
                problems.append(_problem(error, item.line, "constraints"))
        if problems:
            raise InvalidItems(problems)
        return replace(self, _poses=poses)

    @property
    def bundles(self) -> list[str]:
        """Exact bundles, without duplicates."""
        return sorted({reference for _, reference in self.by_bundle})

    def new_report(self) -> ScopeReport | None:
        """Return an empty report on the scopes of its prompts; None if they are not to be examined."""
        return None if self.fields.scope == "ignore" else ScopeReport()

    def new_items(self, report: ScopeReport | None) -> Iterator[NewItem]:
        """Yield one row per motion, and report the scopes of prompts: the body is read a second time, so that it is
        never in memory as a whole."""
        return new_items(self._items(), report=report)

    def examine(self, decided: Mapping[tuple[str, str], Scope] | None = None) -> ScopeReport | None:
        """Return the report on the scopes of all prompts, which are read again.

        Args:
            decided: the encoder's verdicts, by bundle and prompt; None = judged by words alone.
        """
        report = self.new_report()
        if report is not None:
            report.decided = decided or {}
            for item in read_items(self._raws()):
                self._generators[item.model].judge(item, report)
        return report

    def prompts(self) -> Iterator[tuple[int | None, str | None, str, Bundle]]:
        """Yield the prompts with their lines, rows of timelines and bundles; the body is read again."""
        for line, raw in self._raws():
            item, _ = read_item(raw, line)
            if item is not None:
                bundle = self._generators[item.model].bundle
                for row, prompt in prompts_with_rows(item.prompt, item.timeline):
                    yield line, row, prompt, bundle

    def _items(self) -> Iterator[tuple[Item, GeneratorCapabilities]]:
        items = read_items(self._raws())
        return ((posed(item, self._poses), self._generators[item.model]) for item in items)


def read_ndjson(body: BinaryIO, fields: JobFields, catalogue: Catalogue) -> Submission:
    """Parse a job with one item per line; `fields` come from the query. The body stays in use.

    Raises:
        InvalidItems: with the problems of all lines.
        OutOfScope: scope `refuse`, and prompts name actions that the model does not know.
        InvalidInput: there are no items.
        TooLarge: more than 100,000 items, or a line of more than `MAX_VALUE` bytes.
    """
    return _checked(fields, lambda: _lines(body), catalogue)


def _lines(body: BinaryIO) -> Iterator[tuple[int, object]]:
    body.seek(0)
    number = 0
    while line := body.readline(MAX_VALUE + 1):
        number += 1
        if number > MAX_LINES:
            raise TooLarge(f"has over {MAX_LINES:,} lines", where="body", hint="Leave out the blank ones.")
        if len(line) > MAX_VALUE:
            hint = "Write one item a line."
            raise TooLarge(f"is over {MAX_VALUE:,} bytes", where=f"line {number}", hint=hint)
        if line.strip():
            yield number, read_json(line)


def read_document(body: BinaryIO, catalogue: Catalogue) -> Submission:
    """Parse a job as one JSON object with `items`. The body stays in use.

    Raises:
        InvalidItems: with the problems of all items.
        OutOfScope: as `read_ndjson`.
        InvalidInput: the object itself is invalid.
        TooLarge: more than 100,000 items, or one of more than `MAX_VALUE` characters.
    """
    hint = 'Write {"items": [{"prompt": "…"}]}.'
    document = Document(body, ("items",), hint=hint)
    fields = document.fields()
    if not document.has_list or next(document.elements(), None) is None:
        raise InvalidInput("is missing, empty or not a list", where="items", hint=hint)
    return _checked(job_fields(fields, NewJobBody), document.elements, catalogue)


def _checked(fields: JobFields, raws: Raws, catalogue: Catalogue) -> Submission:
    by_bundle: Counter[tuple[str, str]] = Counter()
    checks = _ModelChecks(catalogue)
    for item in read_items(_some(raws()), check=checks.problems):
        bundle = checks.generators[item.model].bundle
        by_bundle[bundle.manifest.model, bundle.reference] += item.variants
    submission = Submission(fields, by_bundle.total(), by_bundle, raws, checks.generators, checks.named)
    if fields.scope == "refuse":
        refuse_unknown(submission.prompts())
    return submission


def _some(raws: Iterator[tuple[int, object]]) -> Iterator[tuple[int, object]]:
    """Yield items with their lines; that there are none is an error."""
    line = 0
    for line, raw in raws:
        yield line, raw
    if not line:
        raise InvalidInput("there are no prompts", where="body", hint='Write {"prompt": "…"}, one a line.')


class _ModelChecks:
    """Checks of items against the models that they name; a model is looked up once, for any number of lines.

    Attributes:
        generators: the models found so far, by the name in the item; None = the default model.
        named: frames of stored motions that constraints name.
    """

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._failed: dict[str | None, MareyError] = {}
        self._default_model: set[Problem] = set()
        self.generators: dict[str | None, GeneratorCapabilities] = {}
        self.named = NamedPoses()

    def problems(self, values: Mapping[str, Any], line: int | None) -> Iterator[Problem]:
        """Yield problems of an item that its model cannot handle.

        Raises:
            TooLarge: the items name over `MAX_MODELS` models.
        """
        model = values.get("model")
        self._look_up(model, line)
        if model in self._failed:
            yield from self._of_model(model, line)
            return
        generator = self.generators[model]
        yield from _beyond_fields(generator, values, line)
        if (constraints := values.get("constraints")) is not None:
            yield from _beyond(generator, values, line)
            yield from self.named.add(constraints, line, model)

    def _look_up(self, model: str | None, line: int | None) -> None:
        """Add a model to those found or failed, where it is new."""
        if model in self.generators or model in self._failed:
            return
        if len(self.generators) + len(self._failed) == MAX_MODELS:
            hint = "Submit them as several jobs."
            raise TooLarge(f"names over {MAX_MODELS} models", where=f"line {line}", hint=hint)
        try:
            self.generators[model] = self._catalogue.capabilities(model)
        except MareyError as error:
            self._failed[model] = error

    def _of_model(self, model: str | None, line: int | None) -> Iterator[Problem]:
        """Yield the problem of a model that failed; that of the default model, which no line names, only once."""
        problem = _problem(self._failed[model], None if model is None else line, "model")
        if problem not in self._default_model:
            yield problem
        if model is None:
            self._default_model.add(problem)


def _beyond_fields(generator: GeneratorCapabilities, values: Mapping[str, Any], line: int | None) -> Iterator[Problem]:
    """Yield the problems of single fields that a model cannot handle."""
    checks = (
        ("seconds", generator.check_seconds),
        ("settings", generator.check_settings),
        ("variety", generator.check_variety),
        ("timeline", generator.check_timeline),
    )
    for name, hold in checks:
        try:
            if name in values:
                hold(values[name])
        except MareyError as error:
            yield _problem(error, line, name)


def _beyond(generator: GeneratorCapabilities, values: Mapping[str, Any], line: int | None) -> Iterator[Problem]:
    """Yield the problem of constraints that do not fit the motion of an item, as far as its length is known."""
    known = {"prompt": "", **{name: values[name] for name in LENGTH_FIELDS if name in values}}
    try:
        generator.check_constraints(Item(**known))
    except InvalidInput as error:
        yield _problem(error, line, "constraints")


def _problem(error: MareyError, line: int | None, field: str) -> Problem:
    """Describe the problem with a field of a line; faults of this server are raised."""
    if error.status >= 500:
        raise error
    place = error.where if error.where and error.where.startswith(f"{field}.") else field
    return Problem(line, place, error.on_a_line)


def job_fields(values: Mapping[str, Any], whole: type[BaseModel] = JobFields) -> JobFields:
    """Validate the fields of the job as a whole.

    Args:
        values: by name.
        whole: model of the whole body, whose fields the problem of an unknown one lists.

    Raises:
        InvalidItems: with the problems of each field.
    """
    return read_fields(JsonJobFields if issubclass(whole, JsonJobFields) else JobFields, values, whole)


def read_fields(model: type[Fields], values: Mapping[str, Any], whole: type[BaseModel] | None = None) -> Fields:
    """Validate fields of a body that the route parses itself.

    Args:
        model: of these fields.
        values: by name.
        whole: model of the whole body, whose fields the problem of an unknown one lists; None = `model`.

    Raises:
        InvalidItems: with the problems of each field.
    """
    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        problems = [
            Problem(None, place_of(each) or "body", problem_of(each, known_fields(whole or model, each["loc"])))
            for each in error.errors()
        ]
        raise InvalidItems(problems) from error


def request_sha256(query: str, body: BinaryIO) -> str:
    """Return the digest that identifies equal submits."""
    digest = hashlib.sha256(query.encode() + b"\n")
    body.seek(0)
    while part := body.read(2**16):
        digest.update(part)
    return digest.hexdigest()
