"""The words without which a pattern cannot match."""

from __future__ import annotations

import pytest

from marey.referee.prompts import development_prompts
from marey.vocabulary.bearing_patterns import bearing_patterns, words_of_bearings
from marey.vocabulary.needed_words import best_of, needed_words


@pytest.mark.parametrize(
    ("pattern", "needed"),
    [
        ("sleepily", ("sleepily",)),
        ("on tip-?toes?", ("on tip",)),
        ("(?:very )?sad", ("sad",)),
        ("(?:very )*sad(?! song)", ("sad",)),
        ("ha{2,}t", ("ha",)),
        ("ha+lt", ("ha",)),
        ("(?:at|to) (?:ease|attention)", ("ease", "attention")),
        ("(?:cat|dog)s", ("cat", "dog")),
        ("(?:cat|dog?)s{0,2}", ("do", "cat")),
        ("(?:cat|(?:dog)?)", ()),
        ("cats|bobcat", ("cats", "bobcat")),
        ("cat|bobcat", ("cat",)),
        ("<hit> it", ("hit",)),
        ("<take> HIS hat", ("take", "took", "taking")),
        ("lifts AND carries", ("carries",)),
        (r"\w+[aeiou]y.", ("y",)),
        (r"(?<=narrow )wire\b", ("wire",)),
    ],
)
def test_words_that_a_pattern_needs(pattern: str, needed: tuple[str, ...]) -> None:
    assert needed_words(pattern) == needed


def test_of_patterns_that_all_match_the_longest_words_are_needed() -> None:
    assert best_of([("on", "sofa"), ("sofa",), ("chair", "bench")]) == ("chair", "bench")
    assert best_of([(), ("a",)]) == ("a",)
    assert best_of([]) == ()


def test_few_patterns_are_tried_on_a_prompt_and_all_that_match() -> None:
    every = [(words.name, kind, pattern) for words in words_of_bearings() for kind, pattern in words.patterns]
    prompts = [prompt.text.lower() for prompt in development_prompts()[::3]]
    tried = [list(bearing_patterns(prompt)) for prompt in prompts]
    assert sum(map(len, tried)) < 0.1 * len(every) * len(prompts)
    for prompt, some in zip(prompts, tried, strict=True):
        assert [each for each in some if each[2].search(prompt)] == [each for each in every if each[2].search(prompt)]
