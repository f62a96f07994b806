"""The rules for prompts, for the command line, the API and the pipeline."""

from __future__ import annotations

import unicodedata

from marey.core.characters import STORED, WHITESPACE, check_text
from marey.core.errors import InvalidInput

MAX_WORDS = 200
"""Whitespace words. A detailed caption has 30 to 60; the encoders see at most 128 to 512 sub-words."""
MAX_CHARACTERS = 2_000
MAX_WORD_CHARACTERS = 100
MIN_LATIN_SHARE = 0.5
"""Minimum share of Latin letters: encoders and labeller read English; other scripts would give an arbitrary motion."""


def check_prompt(prompt: str, *, where: str | None = None, stored: bool = False) -> str:
    """Return the prompt as it is stored and parsed: Unicode NFC, runs of whitespace made one space, ends trimmed.

    Args:
        prompt: the user's text.
        where: line or field, for the error (`line 7`, `items.3.prompt`).
        stored: accepted earlier, perhaps by a release that allowed text direction controls.

    Raises:
        InvalidInput: empty, too long, with control characters, or without English words.
    """
    if len(prompt) > MAX_CHARACTERS * 100:  # avoid normalising megabytes that are refused anyway
        raise _too_long(f"{len(prompt):,} characters", where)
    check_text(prompt, allowed=STORED if stored else WHITESPACE, subject="the prompt", where=where)
    text = " ".join(unicodedata.normalize("NFC", prompt).split())
    if not text:
        raise InvalidInput("the prompt is empty", where=where, hint="Describe a motion: 'a person waves'.")
    _check_size(text, where)
    _check_script(text, where)
    return text


def _check_size(text: str, where: str | None) -> None:
    words = text.split(" ")
    if len(words) > MAX_WORDS:
        raise _too_long(f"{len(words):,} words", where)
    if len(text) > MAX_CHARACTERS:
        raise _too_long(f"{len(text):,} characters", where)
    longest = max(words, key=len)
    if len(longest) > MAX_WORD_CHARACTERS:
        raise InvalidInput(
            f"the word {longest[:20]!r}… has {len(longest):,} characters, at most {MAX_WORD_CHARACTERS} are allowed",
            where=where,
            hint="Put spaces between the words.",
        )


def _check_script(text: str, where: str | None) -> None:
    letters = [c for c in text if c.isalpha()]
    if letters and text.isascii():  # nearly all prompts: 100,000 at once are checked by the command and by the API
        return
    latin = sum(unicodedata.name(c, "").startswith(("LATIN", "FULLWIDTH LATIN")) for c in letters)
    if not letters or latin < MIN_LATIN_SHARE * len(letters):
        raise InvalidInput(
            "the prompt has no English words", where=where, hint="Prompts are read in English: 'a person waves'."
        )


def _too_long(size: str, where: str | None) -> InvalidInput:
    return InvalidInput(
        f"the prompt has {size}; at most {MAX_WORDS} words and {MAX_CHARACTERS:,} characters are allowed",
        where=where,
        hint="Describe one motion per prompt; split longer scripts into several prompts.",
    )
