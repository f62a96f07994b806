"""Forms of verbs and nouns."""

import pytest

from marey.vocabulary.inflection import noun_forms, verb_forms


@pytest.mark.parametrize(
    ("base", "forms"),
    [
        ("walk", "walk walks walking walked"),
        ("run", "run runs running ran"),
        ("carry", "carry carries carrying carried"),
        ("dance", "dance dances dancing danced"),
        ("lie", "lie lies lying lay lain"),
        ("signal", "signal signals signaling signalling signaled signalled"),
        ("tiptoe", "tiptoe tiptoes tiptoeing tiptoed"),
        ("box", "box boxes boxing boxed"),
        ("kneel", "kneel kneels kneeling knelt kneeled"),
        ("hit", "hit hits hitting"),
    ],
)
def test_verbs(base: str, forms: str) -> None:
    assert verb_forms(base) == set(forms.split())


def test_nouns() -> None:
    assert noun_forms("foot") == {"foot", "feet"}
    assert noun_forms("punch") == {"punch", "punches"}
