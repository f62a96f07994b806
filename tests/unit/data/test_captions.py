from __future__ import annotations

import itertools
import re
from typing import get_args

import pytest

from marey.checks.prompts import PromptSet, evaluation_prompts
from marey.data.captions import captions, joined_caption, long_caption, seeded, short_caption
from marey.data.describe import ACTIONS, STYLE_NAMES, describe
from marey.data.english import conjugate, gerund, third, with_adjective
from marey.data.grammar import grammar
from marey.data.phrases import PAIR
from tests.support.bodies import Body, bower, raiser, runner, steady, walker, waver

FPS = 20.0


def facts(content: str, style: str, joints):
    found = describe(content, style, joints, FPS)
    assert found is not None
    return found


EXAMPLES = {
    "walk": lambda: facts("2/walk", "normal", walker()),
    "turn": lambda: facts("2/walk-turn-left", "elderly", walker(5.0, turn=90)),
    "run": lambda: facts("2/run", "active", runner()),
    "walk_back": lambda: facts("1/walk-back", "sad", Body(4.0, speed=steady(-0.8)).joints()),
    "wave": lambda: facts("2/wave-left-hand", "youthful", waver("left")),
    "raise": lambda: facts("2/raise-up-right-hand", "chimpira", raiser("right")),
    "both": lambda: facts("2/wave-both-hands", "giant", waver("both")),
    "bow": lambda: facts("1/bow", "proud", bower()),
}


def many(found, count: int = 300) -> set[str]:
    return {make(found, seeded(k)) for k in range(count) for make in (short_caption, long_caption)}


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_caption_is_complete_english(name):
    for text in many(EXAMPLES[name]()):
        assert not re.search(r"[{}<>]|\s\s|\s[.,]|\bthe both\b|\b(and|a|the)[.]?$", text), text
        assert text.strip() == text


@pytest.mark.parametrize(
    ("name", "side", "wrong"),
    [("turn", "left", "right"), ("wave", "left", "right"), ("raise", "right", "left"), ("both", "both", None)],
)
def test_the_side_of_a_caption_is_the_side_of_the_motion(name, side, wrong):
    for text in many(EXAMPLES[name]()):
        lowered = text.lower().replace("right angle", "")
        if wrong and re.search(rf"\b{wrong}\b", lowered):  # the other arm may be said to hang down
            assert re.search(rf"{wrong} (arm|hand) (hangs|kept|does)", lowered), text
        assert side in lowered or wrong is None, text


def test_a_mirrored_motion_gets_the_other_side():
    joints = waver("left")[..., [0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20], :]
    mirrored = joints * [-1.0, 1.0, 1.0]
    assert facts("2/wave-left-hand", "normal", mirrored).side == "right"


def test_numbers_are_those_that_were_measured():
    walked = facts("2/walk", "normal", walker(5.0))
    for text in many(walked):
        for number in re.findall(r"(\d+) meters", text):
            assert int(number) == round(walked.gait.path)
        for number in re.findall(r"(\d+) seconds", text):
            assert int(number) == 5


def test_a_label_that_the_motion_contradicts_gives_no_facts():
    assert describe("2/walk-turn-left", "normal", walker(), FPS) is None
    assert describe("2/wave-left-hand", "normal", walker(), FPS) is None
    assert describe("1/walk-back", "normal", walker(), FPS) is None
    assert describe("1/kick", "normal", walker(), FPS) is None


def test_the_side_is_that_of_the_motion_though_the_label_says_otherwise():
    assert facts("2/walk-turn-left", "normal", walker(5.0, turn=-90)).side == "right"


@pytest.mark.parametrize("name", EXAMPLES)
def test_long_captions_have_thirty_to_sixty_words(name):
    found = EXAMPLES[name]()
    lengths = [len(long_caption(found, seeded(k)).split()) for k in range(200)]
    assert min(lengths) >= 30
    assert max(lengths) <= 60


def test_each_act_has_ten_phrasings_and_each_style_several():
    words = grammar()
    assert all(len(set(action.phrases)) >= 10 for action in words.actions.values())
    assert set(ACTIONS.values()) <= set(words.actions)
    assert all(len(set(style.after)) >= 5 for style in words.styles.values())
    assert set(STYLE_NAMES.values()) <= set(words.styles)


def test_the_same_clip_has_the_same_captions_everywhere_and_others_have_others():
    found = EXAMPLES["wave"]()
    assert captions([found], "clip-1") == captions([found], "clip-1")
    assert captions([found], "clip-1") != captions([found], "clip-2")
    assert len(set(captions([found], "clip-1"))) == 3


def test_a_sequence_names_its_acts_in_order():
    parts = [EXAMPLES["bow"](), EXAMPLES["wave"]()]
    for k in range(200):
        text = joined_caption(parts, seeded(k)).lower()
        assert "left" in text
        bowing = re.search(r"bow|inclin|bend|upper body|lean|torso|trunk|fold|stoop|waist|dip|hips|respect|greet", text)
        assert bowing, text
        assert bowing.start() < text.index("left"), text


# -- what training must never see --------------------------------------------------------------------------------------


def plain(text: str) -> str:
    return re.sub(r"[^a-z ]", "", text.lower().replace("-", " ")).strip()


def open_fields(phrase: str) -> list[dict[str, str]]:
    """Every way to fill the fields of a phrase that have words of their own."""
    words = grammar()
    tables = {"pace": words.pace, "height": words.height, "lasting": words.lasting, "pair": {"": PAIR}}
    named = {name: sum(table.values(), ()) for name, table in tables.items() if f"{{{name}}}" in phrase}
    return [dict(zip(named, values, strict=True)) for values in itertools.product(*named.values())]


def trained_phrases() -> set[str]:
    """All phrases of the grammar, in all forms, sides and hands, without their measured numbers."""
    out = set()
    words = grammar()
    phrases = [p for action in words.actions.values() for p in (*action.phrases, *action.nouns, *action.whole)]
    phrases += [p for action in words.actions.values() for rows in action.manners.values() for p in rows]
    for phrase in phrases:
        for side, hands in (("left", "left hand"), ("right", "right hand"), ("both", "both hands")):
            for his in ("his", "her", "their", "the"):
                values = {"side": side, "hands": hands, "arms": hands.replace("hand", "arm"), "it": "it", "is": "is"}
                values |= {"hands_his": hands if side == "both" else f"{his} {hands}", "other": "left"}
                values |= {"degrees": "90", "metres": "5", "steps": "5", "seconds": "5"}
                values |= {"one": f"{side} one", "one_side": side}
                for sided in (f"{side}-handed", f"with the {side}", "with both hands"):
                    for angle in ("a right angle", "90 degrees", "ninety degrees", "a quarter of a circle"):
                        some = values | {"sided": sided, "right_angle": angle}
                        for more in open_fields(phrase):
                            filled = phrase.format(**some, **more).replace("the both ", "both ")
                            out |= {plain(conjugate(filled, form)) for form in ("third", "gerund", "base")}
                        if "{right_angle}" not in phrase:
                            break
                    if "{sided}" not in phrase:
                        break
    return out | joined_phrases()


def joined_phrases() -> set[str]:
    """All phrases that two actions have together."""
    out = set()
    joins = grammar().joins
    for phrase in (p for table in (joins.same, joins.pairs) for rows in table.values() for p in rows):
        for a, b in itertools.product(("left", "right", "both"), repeat=2):
            values = {}
            for name, side in (("a", a), ("b", b)):
                hands = f"{side} hands" if side == "both" else f"{side} hand"
                values |= {f"{name}_hands": hands, f"{name}_arms": hands.replace("hand", "arm"), f"{name}_side": side}
                values |= {f"{name}_sided": "with both hands" if side == "both" else f"{side}-handed"}
                values |= {f"{name}_one": f"{side} one", f"{name}_it": "it", f"{name}_pair": "two hands"}
            filled = phrase.format(**values).replace("the both ", "both ")
            out |= {plain(conjugate(filled, form)) for form in ("third", "gerund", "base")}
    return out


def known(text: str, trained: set[str]) -> bool:
    """Return True if a text is a person with a phrase of the grammar, in any style."""
    words = grammar()
    for after in (plain(a) for style in words.styles.values() for a in style.after if a):
        text = re.sub(rf"(^{after} | {after}$)", "", text).strip()
    subjects = [*words.subjects, *(w for action in words.actions.values() for w in action.who)]
    subjects += [w for style in words.styles.values() for w in style.who]
    who = {w for subject in subjects for w in plain(subject).split()}
    who |= {w for style in words.styles.values() for adjective in style.adjective for w in plain(adjective).split()}
    who |= {"is", "an", "after", "starts", "walker", "runner", "actor", "fighter", "old", "young"}
    pieces = text.split()
    begins = itertools.takewhile(lambda k: k == 0 or pieces[k - 1] in who, range(len(pieces)))
    return any(" ".join(pieces[begin:]) in trained for begin in begins)


@pytest.mark.parametrize("which", get_args(PromptSet))
def test_no_evaluation_prompt_can_be_made_by_the_training_grammar(which):
    trained = trained_phrases()
    for prompt in evaluation_prompts(which):
        text = plain(prompt.text)
        assert not known(text, trained), prompt.text
        if len(prompt.expected) > 1:
            clauses = re.split(r"\b(?:and then|and afterwards|then|and|before|finally|first)\b", text)
            assert not all(known(clause.strip(), trained) for clause in clauses if clause.strip()), prompt.text


def test_the_test_above_finds_what_the_grammar_makes():
    trained = trained_phrases()
    for example in (EXAMPLES["turn"](), EXAMPLES["wave"](), EXAMPLES["raise"](), EXAMPLES["bow"]()):
        texts = {plain(short_caption(example, seeded(k))) for k in range(60)}
        found = {text for text in texts if known(text, trained)}
        assert len(found) > 0.9 * len(texts), texts - found


def test_evaluation_prompts_are_two_hundred_and_all_different():
    texts = [plain(p.text) for p in evaluation_prompts()]
    assert len(set(texts)) == 200
    assert sum(p.separate for p in evaluation_prompts()) == 16


def test_no_set_repeats_itself_or_another():
    texts = [plain(p.text) for which in get_args(PromptSet) for p in evaluation_prompts(which)]
    assert len(set(texts)) == len(texts) > 500


# -- English -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("verb", "she", "ing"),
    [
        ("walk", "walks", "walking"),
        ("run", "runs", "running"),
        ("wave", "waves", "waving"),
        ("punch", "punches", "punching"),
        ("go", "goes", "going"),
        ("carry", "carries", "carrying"),
        ("sway", "sways", "swaying"),
        ("step", "steps", "stepping"),
    ],
)
def test_verbs_are_conjugated(verb, she, ing):
    assert (third(verb), gerund(verb)) == (she, ing)


def test_every_verb_of_the_grammar_has_its_forms():
    verbs = {v for action in grammar().actions.values() for p in action.phrases for v in re.findall(r"<(\w+)>", p)}
    assert {gerund(v) for v in verbs} >= {"running", "spinning", "putting", "letting", "cutting", "jogging", "making"}
    assert not [v for v in verbs if re.fullmatch(r"[^aeiou]*[aeiou][bdgmnpt]", v) and gerund(v)[len(v)] != v[-1]]


def test_adjectives_take_the_article_along():
    assert with_adjective("a person", "old") == "an old person"
    assert with_adjective("an individual", "tired") == "a tired individual"
    assert with_adjective("she", "tired") == "she"


def test_both_hands_are_them():
    both = EXAMPLES["both"]()
    assert any("them" in short_caption(both, seeded(k)) for k in range(300))


def test_repeated_acts_say_so():
    from dataclasses import replace

    twice = replace(facts("1/bow", "normal", bower()), repeats=2)
    texts = [short_caption(twice, seeded(k)) for k in range(50)]
    assert any("twice" in text or "repeatedly" in text for text in texts)
