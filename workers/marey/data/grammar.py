"""The caption grammar: `grammar.toml`, read once."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Style:
    """Phrases of a style."""

    after: tuple[str, ...]
    adjective: tuple[str, ...]
    sentence: tuple[str, ...]
    who: tuple[str, ...] = ()


@dataclass(frozen=True)
class Words:
    """Phrases of an action.

    Attributes:
        phrases: verb phrases.
        nouns: noun phrases without a verb ("a wave of the left hand").
        whole: sentences whose subject is the limb ("the left hand goes up").
        who: subjects that fit the action ("a runner").
        manners: verb phrases that include a style, by style ("trudges").
    """

    phrases: tuple[str, ...]
    nouns: tuple[str, ...]
    whole: tuple[str, ...]
    who: tuple[str, ...]
    manners: dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class Joins:
    """Phrases that join actions.

    Attributes:
        two, three: frames for any actions.
        halt: frames for an action in place after travel.
        same: phrases by action, for one action on both sides in turn.
        pairs: by `first-second`, for two actions with a joint phrase.
    """

    two: tuple[str, ...]
    three: tuple[str, ...]
    halt: tuple[str, ...]
    same: dict[str, tuple[str, ...]]
    pairs: dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class Detail:
    """Phrases of a measured detail, to follow the action or as a separate sentence."""

    clause: tuple[str, ...]
    sentence: tuple[str, ...]


@dataclass(frozen=True)
class Grammar:
    """`grammar.toml`."""

    subjects: tuple[str, ...]
    actions: dict[str, Words]
    details: dict[str, Detail]
    pace: dict[str, tuple[str, ...]]
    height: dict[str, tuple[str, ...]]
    lasting: dict[str, tuple[str, ...]]
    styles: dict[str, Style]
    joins: Joins


@lru_cache(maxsize=1)
def grammar() -> Grammar:
    """Load the grammar of the package."""
    table: dict[str, Any] = tomllib.loads(Path(__file__).with_name("grammar.toml").read_text("utf-8"))
    return Grammar(
        subjects=tuple(table["subjects"]),
        actions={action: _words(rows, table["manners"].get(action, {})) for action, rows in table["acts"].items()},
        details={
            name: Detail(tuple(rows["clause"]), tuple(rows["sentence"])) for name, rows in table["details"].items()
        },
        pace={name: tuple(rows) for name, rows in table["pace"].items()},
        height={name: tuple(rows) for name, rows in table["height"].items()},
        lasting={name: tuple(rows) for name, rows in table["lasting"].items()},
        styles={
            name: Style(**{key: tuple(rows[key]) for key in ("after", "adjective", "sentence", "who")})
            for name, rows in table["styles"].items()
        },
        joins=_joins(table["join"]),
    )


def _words(rows: dict[str, Any], manners: dict[str, Any]) -> Words:
    lists = {key: tuple(rows.get(key, ())) for key in ("phrases", "nouns", "whole", "who")}
    return Words(**lists, manners={style: tuple(row["phrases"]) for style, row in manners.items()})


def _joins(rows: dict[str, Any]) -> Joins:
    same, pairs = ({name: tuple(p) for name, p in rows[key].items()} for key in ("same", "pairs"))
    return Joins(tuple(rows["two"]), tuple(rows["three"]), tuple(rows["halt"]), same, pairs)
