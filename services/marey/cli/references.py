"""References that a user types: a whole id, its last digits, a name, `last`, or a motion by its place in a job."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from uuid import UUID

from marey.cli import console
from marey.core.errors import InvalidInput, NotFound

if TYPE_CHECKING:
    from marey.client import Client, Result
    from marey.client.references import ReferenceKind as Kind

FORMS = "its id, the last 8 digits of it, a name, or last"
MOTION_FORMS = "an id, the last 8 digits of it, JOB:INDEX or JOB:INDEX.VARIANT (both from 0), or last"
LAST = "last"
LISTED = 5
LISTS = {
    "job": "marey jobs list",
    "motion": "marey motions list",
    "evaluation": "marey eval list",
    "schedule": "marey eval schedule list",
    "webhook": "marey webhooks list",
    "delivery": "marey webhooks deliveries WEBHOOK",
    "key": "marey admin keys list",
}


@dataclass(frozen=True)
class Reference:
    """The object that an argument of a command names."""

    kind: str
    id: str
    match: Mapping[str, Any] | None = None
    """The server's description; None = the argument is a whole id, and the server was not asked."""

    def __str__(self) -> str:
        """`job 1a2b3c4d 'day 1' (120 items)`."""
        return describe(self.match or {"kind": self.kind, "id": self.id})


def whole_id(text: str) -> str | None:
    """Return the text as an id; None if it is not a whole one."""
    try:
        return str(UUID(text)) if len(text) in (32, 36) else None
    except ValueError:
        return None


def find(client: Client, kind: Kind, text: str, *, webhook: str | None = None) -> Reference:
    """Resolve a reference; the server is asked unless it is a whole id.

    Raises:
        NotFound: there is no such object.
        InvalidInput: it is ambiguous; the error lists the candidates.
    """
    if (identifier := whole_id(text)) is not None:
        return Reference(kind, identifier)
    return choose(kind, text, [match.raw for match in client.references.resolve(kind, text, webhook=webhook)])


def find_all(client: Client, kind: Kind, texts: Iterable[str], *, webhook: str | None = None) -> list[Reference]:
    """Resolve several references before anything is done to one of them; the same object is listed once."""
    found = [find(client, kind, text, webhook=webhook) for text in texts]
    return list({each.id: each for each in found}.values())


def with_names(client: Client, found: Iterable[Reference]) -> Iterator[Reference]:
    """Yield each object with its name, for the messages of commands that cannot be undone."""
    for each in found:
        yield each if each.match is not None else of_view(each.kind, _view(client, each))


def _view(client: Client, found: Reference) -> Mapping[str, Any]:
    get: dict[str, Callable[[str], Result]] = {
        "job": client.jobs.get,
        "schedule": client.schedules.get,
        "webhook": client.webhooks.get,
    }
    return get[found.kind](found.id).raw


def describe_all(found: Sequence[Reference]) -> str:
    """Describe the objects of a question: each by name, or their number."""
    return ", ".join(map(str, found)) if len(found) <= LISTED else f"{len(found)} {found[0].kind}s"


def choose(kind: str, text: str, matches: Sequence[Mapping[str, Any]]) -> Reference:
    """Return the only match.

    Raises:
        NotFound, InvalidInput: as `find`.
    """
    if not matches:
        where, hint = f"{kind} {text[:80]!r}", f"`{LISTS[kind]}` shows yours."
        raise NotFound(
            f"there is no {kind} yet" if text == LAST else f"there is no such {kind}", where=where, hint=hint
        )
    if len(matches) > 1:
        lines = "\n".join(f"  {each['id']}  {describe(each)}, {console.moment(each['created'])}" for each in matches)
        raise InvalidInput(
            f"{text[:80]!r} may be any of these:\n{lines}",
            where=f"{kind.upper()}",
            hint="Give the whole id, or more of its last digits.",
        )
    return Reference(kind, str(matches[0]["id"]), matches[0])


def describe(match: Mapping[str, Any]) -> str:
    """Describe a match in a few words."""
    words = [str(match["kind"]), console.short_id(str(match["id"]))]
    if match.get("name"):
        words.append(repr(match["name"]))
    if match.get("items") is not None:
        words.append(f"({match['items']} items)" if match["items"] != 1 else "(1 item)")
    if match.get("job"):
        words.append(f"({console.short_id(str(match['job']))}:{match['index']}.{match['variant']})")
    return " ".join(words)


def of_view(kind: str, view: Mapping[str, Any]) -> Reference:
    """Describe an object by its view in the API."""
    match = {"kind": kind, "id": view["id"], "name": view.get("name"), "items": view.get("total")}
    return Reference(kind, str(view["id"]), match)
