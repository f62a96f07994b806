"""Forms of verbs and nouns."""

import pytest

from marey.vocabulary.inflection import in_form_of, in_present_form_of, noun_forms, verb_forms


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


@pytest.mark.parametrize(
    ("said", "verb", "form", "present"),
    [
        ("", "sit", "sit", "sit"),
        ("e", "fall", "fall", "fall"),
        ("es", "fall", "falls", "falls"),
        ("SLUMPS", "sit", "sits", "sits"),
        ("ping", "fall", "falling", "falling"),
        ("ting", "jog", "jogging", "jogging"),
        ("ped", "fall", "fall", "falls"),
        ("lost", "march", "march", "marches"),
    ],
)
def test_a_verb_in_the_form_of_another_one(said: str, verb: str, form: str, present: str) -> None:
    assert in_form_of(said, verb) == form
    assert in_present_form_of(said, verb) == present
