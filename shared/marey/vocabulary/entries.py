"""Entries of the vocabulary, read from `vocabulary.toml`."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Literal, cast, get_args

from marey.core.errors import InvalidFile, NotFound
from marey.vocabulary.inflection import phrase_in_third_person

Support = Literal["feet", "seat", "hands", "whole-body", "raised", "none"]
"""Part of the body that rests on something; `raised`: on something over the floor, `none`: on nothing."""
Sided = Literal["", "direction", "hand", "foot"]
"""Meaning of left and right in a prompt of the action: where to, which hand, which foot."""

_FILE = Path(__file__).with_name("vocabulary.toml")
FLIGHT_SECONDS = 0.3
"""Longest flight of an action that states none."""

_FIELDS = {
    "definition",
    "verbs",
    "nouns",
    "near",
    "implies",
    "kind_of",
    "support",
    "sided",
    "flight_s",
    "in_place",
    "plain",
    "counted",
}


@dataclass(frozen=True)
class Action:
    """One action.

    Attributes:
        id: its name, in kebab-case.
        definition: what the body does, precise enough for an independent author to write a checker from.
        verbs: verb phrases in their base form; their first word is inflected.
        plain: the verb phrase by which models know it best, in its base form.
        nouns: noun phrases in the singular; their last word is inflected.
        near: verbs and nouns that are read as this action though its definition does not promise them.
        support: part of the body that carries it.
        flight_s: longest time off its support in one stretch, seconds.
        in_place: may be done without travel though its words say travel (a walk cycle).
        implies: actions that every clip of this action shows as well.
        kind_of: the action that this one is a manner of; it is read as that where a bundle knows no better.
        sided: meaning of left and right.
        counted: it is done as often as the prompt says (`REPETITIONS` of `marey.selector`).
    """

    id: str
    definition: str
    verbs: tuple[str, ...]
    plain: str
    nouns: tuple[str, ...]
    near: tuple[str, ...] = ()
    support: Support = "feet"
    flight_s: float = FLIGHT_SECONDS
    in_place: bool = False
    implies: tuple[str, ...] = ()
    kind_of: str = ""
    sided: Sided = ""
    counted: bool = False

    @property
    def plain_words(self) -> str:
        """Return the plain phrase as a sentence: "a person waves a hand"."""
        return f"a person {phrase_in_third_person(self.plain)}"


@dataclass(frozen=True)
class Vocabulary:
    """All actions, with the hash of the file that they were read from."""

    actions: Mapping[str, Action]
    sha256: str

    def need(self, name: str) -> Action:
        """Return an action by its id.

        Raises:
            NotFound: no action has this id.
        """
        action = self.actions.get(name)
        if action is None:
            raise NotFound(f"unknown action {name!r}", hint=f"Known: {', '.join(self.actions)}.")
        return action

    def without_implied(self, names: Set[str]) -> set[str]:
        """Return those of some actions, by their ids, that no other of them implies."""
        return set(names).difference(*(self.actions[name].implies for name in names))

    def said_first(self, text: str) -> str | None:
        """Return the id of the action whose plain words a text is, or begins with, as `marey.text.plain_action` makes
        it."""
        text = f"{text.lower()}, "
        said = ((name, text.removeprefix(words)) for words, name in self._first_words.items() if text.startswith(words))
        return next((name for name, rest in said if not rest.startswith(("and ", "then "))), None)

    @cached_property
    def _first_words(self) -> dict[str, str]:
        return {f"{action.plain_words}, ": action.id for action in self.actions.values()}

    @cached_property
    def _implied(self) -> dict[str, frozenset[str]]:
        return {name: frozenset(self._closure(name)) - {name} for name in self.actions}

    def implied(self, name: str) -> frozenset[str]:
        """Ids of all actions that a clip of this one shows as well, directly or through others."""
        return self._implied[name]

    def kinds(self, name: str) -> Iterator[str]:
        """Yield the actions that this one is a manner of, the nearest first."""
        seen = {name}
        while (name := self.actions[name].kind_of) and name not in seen:
            seen.add(name)
            yield name

    def _closure(self, name: str) -> set[str]:
        found, open_names = set[str](), [name]
        while open_names:
            current = open_names.pop()
            if current not in found:
                found.add(current)
                open_names += self.actions[current].implies
        return found


@lru_cache(maxsize=1)
def load_vocabulary() -> Vocabulary:
    """Read the vocabulary that this version ships."""
    return parse_vocabulary(_FILE.read_bytes(), _FILE.name)


def parse_vocabulary(data: bytes, where: str) -> Vocabulary:
    """Read a vocabulary from its TOML file.

    Raises:
        InvalidFile: no TOML, an unknown field or value, or `implies` naming no action.
    """
    try:
        tables = tomllib.loads(data.decode("utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InvalidFile(f"is not a TOML file: {error}", where=where) from None
    actions = {name: _action(name, table, where) for name, table in tables.items()}
    for action in actions.values():
        if missing := [name for name in action.implies if name not in actions]:
            raise InvalidFile(f"implies names no action: {', '.join(missing)}", where=f"{where}: {action.id}")
        if action.kind_of and action.kind_of not in actions:
            raise InvalidFile(f"kind_of names no action: {action.kind_of}", where=f"{where}: {action.id}")
    return Vocabulary(actions, hashlib.sha256(data).hexdigest())


def _action(name: str, value: object, where: str) -> Action:
    place = f"{where}: {name}"
    if not isinstance(value, dict):
        raise InvalidFile("is not a table", where=place, hint="Write one table an action: [walk].")
    table = cast("dict[str, Any]", value)
    if unknown := sorted(set(table) - _FIELDS):
        raise InvalidFile(f"unknown field {unknown[0]!r}; known: {', '.join(sorted(_FIELDS))}", where=place)
    definition = table.get("definition")
    if not isinstance(definition, str) or not definition:
        raise InvalidFile("definition is missing", where=place)
    verbs = _words(table, "verbs", place)
    if not verbs:
        raise InvalidFile("verbs is missing", where=place)
    return Action(
        id=name,
        definition=definition,
        verbs=verbs,
        plain=str(table.get("plain", verbs[0])),
        nouns=_words(table, "nouns", place),
        near=_words(table, "near", place),
        support=cast("Support", _one_of(table, "support", "feet", get_args(Support), place)),
        flight_s=float(table.get("flight_s", FLIGHT_SECONDS)),
        in_place=bool(table.get("in_place", False)),
        implies=_words(table, "implies", place),
        kind_of=str(table.get("kind_of", "")),
        sided=cast("Sided", _one_of(table, "sided", "", get_args(Sided), place)),
        counted=bool(table.get("counted", False)),
    )


def _one_of(table: dict[str, Any], field: str, default: str, known: tuple[str, ...], place: str) -> str:
    value = table.get(field, default)
    if value not in known:
        raise InvalidFile(f"unknown {field} {value!r}; known: {', '.join(filter(None, known))}", where=place)
    return str(value)


def _words(table: dict[str, Any], field: str, place: str) -> tuple[str, ...]:
    value: Any = table.get(field, [])
    if not isinstance(value, list):
        raise InvalidFile(f"{field} is not a list of words", where=place)
    words = cast("list[object]", value)
    if not all(isinstance(word, str) and word for word in words):
        raise InvalidFile(f"{field} is not a list of words", where=place)
    if len(set(words)) < len(words):
        raise InvalidFile(f"{field} names {next(w for w in words if words.count(w) > 1)!r} twice", where=place)
    return tuple(map(str, words))
