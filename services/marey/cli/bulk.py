"""Commands that do the same to several objects: each is found before anything is done to the first."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from marey.cli import console
from marey.cli.references import describe_all, find_all, with_names

if TYPE_CHECKING:
    from marey.cli.references import Kind, Reference
    from marey.client import Client, Result


def change_all(
    kind: Kind,
    texts: Iterable[str],
    change: Callable[[Client, str], Result],
    describe: Callable[[Any], str],
    *,
    as_json: bool,
) -> None:
    """Change objects, and print each as JSON or in words.

    Args:
        texts: references, as typed.
        change: changes the object with an id, and returns it.
        describe: returns the words for a changed object.
    """
    from marey.client import Client

    with Client() as client:
        for each in find_all(client, kind, texts):
            found = change(client, each.id)
            if as_json:
                console.result_json(found.raw)
            else:
                console.say(describe(found))


def delete_all(
    kind: Kind,
    texts: Iterable[str],
    delete: Callable[[Client, Reference], object],
    *,
    question: str,
    done: str | None,
    yes: bool,
) -> None:
    """Ask once, then do to objects what cannot be undone.

    Args:
        texts: references, as typed.
        delete: acts on an object.
        question: with `{}` for the objects.
        done: a message for each object, with `{}` for it; None = `delete` prints its own.
        yes: do not ask.
    """
    from marey.client import Client

    with Client() as client:
        found = find_all(client, kind, texts)
        console.confirm(question.format(describe_all(found)), yes=yes)
        for each in with_names(client, found):
            delete(client, each)
            if done is not None:
                console.say(done.format(each))
