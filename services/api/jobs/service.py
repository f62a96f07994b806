"""What a submit does before the database sees it: read the body, fix bundles and seeds, hash."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from services.api.catalogue import Catalogue
from services.api.jobs.schemas import JobFields
from shared.errors import InvalidInput, MareyError, TooLarge
from shared.items import MAX_ITEMS, InvalidItems, Item, Problem, read_items, read_json
from shared.jobs import NewItem
from shared.offers import Offer, new_items

Fields = TypeVar("Fields", bound=BaseModel)


@dataclass(frozen=True)
class Submission:
    """A checked request body."""

    fields: JobFields
    items: list[Item]
    offers: list[Offer]
    """The exact bundle of each item."""

    @property
    def count(self) -> int:
        """Motions to make."""
        return sum(item.variants for item in self.items)

    @property
    def bundles(self) -> list[str]:
        """Exact bundles, each once."""
        return sorted({offer.bundle.reference for offer in self.offers})

    @property
    def by_bundle(self) -> Counter[tuple[str, str]]:
        """Motions by model and exact bundle."""
        counts: Counter[tuple[str, str]] = Counter()
        for item, offer in zip(self.items, self.offers, strict=True):
            counts[offer.bundle.manifest.model, offer.bundle.reference] += item.variants
        return counts

    def new_items(self) -> Iterator[NewItem]:
        """One row a motion."""
        return new_items(zip(self.items, self.offers, strict=True))


def read_ndjson(body: bytes, fields: JobFields, catalogue: Catalogue) -> Submission:
    """A job of one item a line; `fields` stood in the query.

    Raises:
        InvalidItems: with the problems of all lines.
        TooLarge: more than 100,000 items.
    """
    lines = body.split(b"\n")
    filled = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    _check_length(len(filled))
    return _checked(fields, ((number, read_json(line)) for number, line in filled), catalogue)


def read_document(body: bytes, catalogue: Catalogue) -> Submission:
    """A job as one JSON object with `items`.

    Raises:
        InvalidItems: with the problems of all items.
        InvalidInput: the object itself is wrong.
        TooLarge: more than 100,000 items.
    """
    document = read_object(body, hint='Write {"items": [{"prompt": "…"}]}.')
    raws = document.pop("items", None)
    if not isinstance(raws, list) or not raws:
        raise InvalidInput("is missing, empty or not a list", where="items", hint='Write {"items": [{"prompt": "…"}]}.')
    _check_length(len(raws))
    return _checked(job_fields(document), enumerate(raws, 1), catalogue)


def read_object(body: bytes, *, hint: str | None = None) -> dict[str, Any]:
    """A body that is a JSON object.

    Raises:
        InvalidInput: it is none.
    """
    try:
        document = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"the body is not JSON: {error}", where="body") from error
    if not isinstance(document, dict):
        raise InvalidInput("the body is not a JSON object", where="body", hint=hint)
    return document


def _check_length(lines: int) -> None:
    if lines > MAX_ITEMS:
        raise TooLarge(f"{lines} items are over the limit of {MAX_ITEMS} a job", hint="Submit them as several jobs.")


def _checked(fields: JobFields, raws: Iterator[tuple[int, object]], catalogue: Catalogue) -> Submission:
    lines: list[int] = []

    def remembered() -> Iterator[tuple[int, object]]:
        for line, raw in raws:
            lines.append(line)
            yield line, raw

    items = read_items(remembered())
    offers: list[Offer] = []
    problems: list[Problem] = []
    for line, item in zip(lines, items, strict=True):
        found = _offer(line, item, catalogue)
        if isinstance(found, Offer):
            offers.append(found)
        elif found not in problems:
            problems.append(found)
    if problems:
        raise InvalidItems(problems)
    return Submission(fields, items, offers)


def _offer(line: int, item: Item, catalogue: Catalogue) -> Offer | Problem:
    """What the item is made with, or why it cannot be made."""
    field = "model"
    try:
        offer = catalogue.offer(item.model)
        field = "seconds"
        offer.check_seconds(item.seconds)
        field = "settings"
        offer.check_settings(item.settings)
    except MareyError as error:
        if error.status >= 500:
            raise
        where = None if item.model is None and field == "model" else line  # the default model is nobody's line
        return Problem(where, field, f"{error.message}. {error.hint}" if error.hint else error.message)
    return offer


def job_fields(values: Mapping[str, Any]) -> JobFields:
    """What concerns the job as a whole.

    Raises:
        InvalidItems: with the problems of each field.
    """
    return read_fields(JobFields, values)


def read_fields(model: type[Fields], values: Mapping[str, Any]) -> Fields:
    """Fields of a body that is read by hand.

    Raises:
        InvalidItems: with the problems of each field.
    """
    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        problems = [Problem(None, ".".join(map(str, e["loc"])) or "body", e["msg"]) for e in error.errors()]
        raise InvalidItems(problems) from error


def request_sha256(query: str, body: bytes) -> str:
    """What makes two submits the same request."""
    return hashlib.sha256(query.encode() + b"\n" + body).hexdigest()
