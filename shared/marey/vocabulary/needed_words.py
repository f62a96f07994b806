"""Words that a text must have for a pattern to match in it: most patterns of a table are not even compiled then."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import cache

from marey.vocabulary.inflection import verb_forms

Needed = tuple[str, ...]
"""One of these stands in each text that a pattern matches; empty = nothing is known of them."""

_TOKEN = re.compile(
    r"""
      <(?P<verb>\w+)>
    | (?P<look>\(\?<?[=!])
    | (?P<open>\(\?:)
    | (?P<close>\))
    | (?P<either>\|)
    | (?P<maybe>(?:[?*]|\{0?,\d*\}|\{0\})\??)
    | (?P<more>(?:\+|\{\d[^}]*\})\??)
    | (?P<other>[A-Z]+\ ?|\[[^\]]*\]|\\.|[.$^])
    | (?P<letter>.)
    """,
    re.VERBOSE,
)


@cache
def forms_needed(verb: str) -> Needed:
    """Return the forms of a verb but those that have another one in them."""
    return _shortest(verb_forms(verb))


def needed_words(pattern: str) -> Needed:
    """Return words of which one stands in each text that a pattern matches.

    Args:
        pattern: with `<verb>` for all forms of a verb, and names in capitals, with or without a space behind, for
            patterns of which nothing is known. It has no other groups than `(?:…)` and what looks ahead or behind.
    """
    return _either(_TOKEN.finditer(pattern))


def needed_of_all(several: Iterable[Needed]) -> Needed:
    """Return what patterns need of which one has to match."""
    found = list(several)
    return _shortest(word for needed in found for word in needed) if all(found) else ()


def best_of(several: Iterable[Needed]) -> Needed:
    """Return what is needed by patterns that must all match, as the words that the fewest texts have."""
    return max(several, key=lambda needed: (min(map(len, needed), default=0), -len(needed)), default=())


def _either(tokens: Iterator[re.Match[str]]) -> Needed:
    """Read up to the end of a group."""
    ways, parts = list[Needed](), list[str | Needed]()
    for token in tokens:
        kind, text = token.lastgroup, token[0]
        if kind == "close":
            break
        if kind == "either":
            ways.append(_sequence(parts))
            parts = []
        elif kind == "maybe":
            parts[-1] = ()
        elif kind == "more":
            parts.append(())  # the letter before it may stand several times
        elif kind == "verb":
            parts.append(forms_needed(token["verb"]))
        elif kind in ("open", "look"):
            inside = _either(tokens)
            parts.append(inside if kind == "open" else ())
        else:
            parts.append(text if kind == "letter" else ())
    return needed_of_all([*ways, _sequence(parts)])


def _sequence(parts: Iterable[str | Needed]) -> Needed:
    """Return what letters, and parts with what each needs, need behind each other."""
    found, run = list[Needed](), ""
    for part in (*parts, ()):
        if isinstance(part, str):
            run += part
            continue
        found += [(run,), part] if run else [part]
        run = ""
    return best_of(found)


def _shortest(words: Iterable[str]) -> Needed:
    kept = list[str]()
    for word in sorted(set(words), key=lambda word: (len(word), word)):
        if not any(short in word for short in kept):
            kept.append(word)
    return tuple(kept)
