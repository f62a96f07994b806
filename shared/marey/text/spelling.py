"""Spelling of motion words: an unknown word within one edit of exactly one motion word is corrected to it."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

from marey.text.encoders import find_encoder
from marey.text.minilm_bundle import load_tokenizer
from marey.text.words import one_slip

MIN_LETTERS = 4
_MOTION_WORDS = """
walk walks walking walked run runs running jog jogs jogging jump jumps jumping step steps stepping turn turns turning
turned raise raises raising raised lift lifts lifting lower lowers wave waves waving waved bow bows bowing kick kicks
kicking punch punches punching slash slashes slashing dance dances dancing danced kneel kneels kneeling crouch
crouches squat squats crawl crawls crawling climb climbs throw throws throwing catch catches stand stands standing
sit sits sitting stretch stretches bend bends bending stumble stumbles push pushed pushes swing swings rotate rotates
spin spins march marches stroll strolls hop hops skip skips clap claps point points look looks move moves moving
perform performs performing start starts starting stop stops stopping person human someone forward forwards backward
backwards sideways left right clockwise counterclockwise slowly quickly carefully happily angrily sadly proudly
tired exhausted elderly childish feminine masculine youthful circle straight degrees meters seconds hand hands arms
foot feet legs head knees shoulder shoulders both while then before after again twice times around ground
"""
MOTION_WORDS = tuple(dict.fromkeys(_MOTION_WORDS.split()))


class Speller:
    """Spelling correction for words of motion.

    Args:
        known: words that are right as they are.
    """

    def __init__(self, known: Iterable[str]) -> None:
        self._known = frozenset(known) | frozenset(MOTION_WORDS)
        self._by_length: dict[int, list[str]] = {}
        for word in MOTION_WORDS:
            if len(word) >= MIN_LETTERS:
                self._by_length.setdefault(len(word), []).append(word)

    @classmethod
    def load(cls) -> Speller:
        """Load a speller with MiniLM's 23,000 whole words as its dictionary.

        Raises:
            NotFound: MiniLM is not installed.
        """
        return cls(_dictionary())

    def correct(self, text: str) -> str:
        """The text with its misspelt motion words corrected; punctuation and all other words stay."""
        return " ".join(self._word(word) for word in text.split(" "))

    def _word(self, word: str) -> str:
        core = word.strip(".,;:!?\"'()")
        letters = core.lower()
        if len(letters) < MIN_LETTERS or not letters.isalpha() or letters in self._known:
            return word
        near = [w for n in (-1, 0, 1) for w in self._by_length.get(len(letters) + n, ()) if one_slip(letters, w)]
        near = [w for w in near if w[0] == letters[0]] or near  # the first letter is seldom wrong
        return word.replace(core, near[0]) if len(near) == 1 else word


@lru_cache(maxsize=1)
def _dictionary() -> frozenset[str]:
    vocabulary = load_tokenizer(find_encoder("minilm")).get_vocab()
    return frozenset(piece for piece in vocabulary if piece.isalpha())
