"""Scope of a prompt by its meaning: the nearest phrases of the vocabulary decide where its words do not.

Phrases and prompts are compared by the cosine of their sentence vectors. The limits are those of `MEANING_ENCODERS`,
set on the sets `development` and `meaning` of `marey.checks.scope_prompts`; a change raises `MEANING_VERSION`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from marey.core.settings import Settings, settings
from marey.text.kept_vectors import KeptVectors
from marey.vocabulary.entries import Action, load_vocabulary
from marey.vocabulary.inflection import third_person
from marey.vocabulary.lexicon import EXACT, WILDCARD
from marey.vocabulary.scope import ActionLists, Scope, match_as, match_as_thing, match_left_out, match_scope
from marey.vocabulary.take_names import as_words

if TYPE_CHECKING:
    from marey.text.pipeline import TextPipeline

NOUN_LIMIT = 0.57
"""Cosine to the nearest phrase of the named action, under which a noun names a thing."""
VERB_LIMIT = 0.55
"""Cosine to the nearest phrase of all, from which on an unlisted verb is read as its action."""
NEUTRAL = ("a person", "a person does something")
"""Phrases that a prompt is nearer to if it names no action."""
CHUNK = 64
"""Phrases of one call of the encoder, between which other prompts get their turn."""

Pooled = Callable[[Sequence[str]], list[NDArray[np.float32]]]
"""One unit vector a text: `TextPipeline.pooled`."""
LeftOut = Callable[[Sequence[str]], Sequence[tuple[str, ...]]]
"""Parts of each prompt that its reading leaves out: `TextPipeline.left_out`."""


class MeaningJudge:
    """Judge of prompts that words leave undecided. Vectors of phrases are computed on first use and kept."""

    def __init__(self, pooled: Pooled, kept: KeptVectors | None = None, left_out: LeftOut | None = None) -> None:
        """Put a judge together; most callers want `of`.

        Args:
            kept: files of the vectors of all phrases, which take seconds to make; None = none.
            left_out: returns the parts of prompts that the readers leave out; None = they are not looked for.
        """
        self._pooled = pooled
        self._kept = kept
        self._left_out = left_out
        self._vectors: dict[tuple[str, ...], NDArray[np.float32]] = {}
        self._verbs: tuple[list[str], NDArray[np.float32]] | None = None

    @classmethod
    def of(cls, pipeline: TextPipeline, *, config: Settings | None = None) -> MeaningJudge:
        """Return the judge by the encoder of a pipeline, with the vectors that the home keeps."""
        return cls(
            pipeline.pooled, KeptVectors((config or settings()).home, pipeline.encoder.sha256), pipeline.left_out
        )

    def judge(self, prompt: str, lists: ActionLists) -> Scope:
        """Return the scope of a prompt, by its words where they decide.

        Args:
            prompt: as `check_prompt` returns it.
            lists: actions of the bundle that will read it.
        """
        scope = match_scope(prompt, lists)
        if scope.left is None:
            return scope
        if scope.left == "part":
            (parts,) = self._left_out([prompt]) if self._left_out is not None else [()]
            return match_left_out(_decided(scope), parts)
        (vector,) = self._pooled([as_words(prompt)])
        if scope.left == "noun":
            names = [each.action for each in scope.actions if each.action is not None]
            is_thing = self.noun_cosine(vector, names) < NOUN_LIMIT
            return match_as_thing(scope, prompt) if is_thing else _decided(scope)
        action, cosine = self.nearest_verb(vector)
        return _decided(scope) if action is None or cosine < VERB_LIMIT else match_as(prompt, action, lists)

    def noun_cosine(self, vector: NDArray[np.float32], actions: Iterable[str]) -> float:
        """Return the cosine of a prompt (W,) to the nearest phrase of these actions."""
        vocabulary = load_vocabulary()
        texts = tuple(text for name in actions for text in _phrases(vocabulary.need(name)))
        return float((self._matrix(texts) @ vector).max())

    def nearest_verb(self, vector: NDArray[np.float32]) -> tuple[str | None, float]:
        """Return the action of the phrase nearest to a prompt (W,), with its cosine; None = it is nearer to neutral
        phrases."""
        if self._verbs is None:
            pairs = [(each.id, text) for each in load_vocabulary().actions.values() for text in _verb_phrases(each)]
            texts = [text for _, text in pairs]
            matrix = self._encode(texts) if self._kept is None else self._kept.get(texts, self._encode)
            self._verbs = [name for name, _ in pairs], matrix
        names, matrix = self._verbs
        cosines = matrix @ vector
        best = int(cosines.argmax())
        neutral = float((self._matrix(NEUTRAL) @ vector).max())
        return (None if neutral >= cosines[best] else names[best]), float(cosines[best])

    def _matrix(self, texts: tuple[str, ...]) -> NDArray[np.float32]:
        if texts not in self._vectors:
            self._vectors[texts] = self._encode(texts)
        return self._vectors[texts]

    def _encode(self, texts: Sequence[str]) -> NDArray[np.float32]:
        parts = (self._pooled(texts[low : low + CHUNK]) for low in range(0, len(texts), CHUNK))
        return np.stack([vector for part in parts for vector in part])


def _decided(scope: Scope) -> Scope:
    return Scope(scope.actions, scope.flags, by="encoder")


def _phrases(action: Action) -> list[str]:
    return [*_verb_phrases(action), *(f"a person does a {noun}" for noun in action.nouns)]


def _verb_phrases(action: Action) -> list[str]:
    return [_sentence(phrase) for phrase in (*action.verbs, *action.near)]


def _sentence(phrase: str) -> str:
    """Return a verb phrase as a sentence: "a person waves goodbye", "a person is lying on back"."""
    begins_exactly = phrase.startswith(EXACT)
    first, *rest = (word.removeprefix(EXACT) for word in phrase.split() if word != WILDCARD)
    return " ".join(["a person", f"is {first}" if begins_exactly else third_person(first), *rest])
