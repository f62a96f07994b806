"""Scope of prompts by their words."""

import csv
from pathlib import Path

import pytest

from marey.bundles import Bundle
from marey.checks.scope_prompts import IN_SCOPE, is_right, scope_prompts, scope_rates
from marey.vocabulary.report import warn_of
from marey.vocabulary.scope import ActionLists, every_action, match_scope
from tests.support.marey import REPOSITORY

FEW = ActionLists(
    supported=("walk", "walk-backward", "run", "turn", "wave", "raise-arm", "bow"),
    tried=("kick", "punch", "slash", "dance"),
)
ALL = every_action()
DEVELOPMENT = scope_prompts("development")


def read_captions(folder: Path) -> list[str]:
    """Captions of a data set, those of one cell apart."""
    texts: list[str] = []
    for file in sorted(folder.glob("captions-*.csv")):
        with file.open(encoding="utf-8", newline="") as lines:
            cells = [cell for row in csv.reader(lines) for cell in row[1:]]
        texts += [text.strip() for cell in cells for text in cell.split("|") if len(text.split()) > 2]
    return texts


def test_the_development_set_has_nine_classes() -> None:
    assert len(DEVELOPMENT) >= 150
    assert len({prompt.group for prompt in DEVELOPMENT}) == 9


@pytest.mark.parametrize("group", dict.fromkeys(prompt.group for prompt in DEVELOPMENT))
def test_rates_on_the_development_set(group: str) -> None:
    (rate,) = scope_rates([prompt for prompt in DEVELOPMENT if prompt.group == group], ALL)
    assert rate.share >= (0.97 if group == IN_SCOPE else 0.9)


def test_the_published_rates_are_those_of_the_test_set() -> None:
    """The other author's prompts choose no words: a change of words changes the page, not the set."""
    page = (REPOSITORY / "docs" / "reference" / "scope.md").read_text()
    starter = Bundle.open(REPOSITORY / "models" / "hgm3-starter", verify=False).manifest.actions
    assert starter is not None
    prompts = scope_prompts("test")
    for rate, few in zip(scope_rates(prompts, ALL), scope_rates(prompts, starter), strict=True):
        last = "" if rate.group == IN_SCOPE else f" {few.right}"
        assert f"| {rate.group} | {rate.prompts} | {rate.right} |{last} |" in page


def test_the_action_of_an_in_scope_prompt_is_found() -> None:
    wrong = [
        prompt.text
        for prompt in DEVELOPMENT
        if prompt.action and prompt.action not in {named.action for named in match_scope(prompt.text, ALL).actions}
    ]
    assert len(wrong) <= 3, wrong


@pytest.mark.parametrize(
    "prompt",
    [
        "a man walks a slackline",  # a place, or the way of it
        "he makes a flourish",  # an action
        "the boxer throws a nifty jab",
        "she performs a series of jumps",
        "a person raises the roof",
        "a person bows deeply",  # no bow
        "crosses the bridge",  # "cross" takes no objects
        "climbs the slope",
        "raises her eyebrows",
    ],
)
def test_a_noun_in_no_list_is_an_object_only_behind_a_verb_of_the_hands(prompt: str) -> None:
    assert "objects" not in match_scope(prompt, ALL).flags


@pytest.mark.parametrize(
    "prompt",
    [
        *("Walk_01", "Attack_2", "Idle_v2", "walk_fwd_45", "turn_90_L", "turns 90", "take 2: walking"),  # names, angles
        *("one person walks", "one hand waves", "goes up one step after another", "3D walk"),
    ],
)
def test_a_number_that_counts_no_repetitions_is_no_count(prompt: str) -> None:
    assert "counts" not in match_scope(prompt, ALL).flags


@pytest.mark.parametrize(
    "prompt",
    [
        "a person walks",
        "an angry knight runs",
        "a sorceress waves",
        "a staggering walk",
        "the left arm waves",
        "a jump kick",
    ],
)
def test_a_subject_that_is_known_or_named_by_what_it_does_is_not_flagged(prompt: str) -> None:
    assert "subject" not in match_scope(prompt, ALL).flags


def test_a_prompt_out_of_scope_is_right_only_as_unknown() -> None:
    dog = next(prompt for prompt in DEVELOPMENT if prompt.text == "the dog barks")
    assert is_right(dog, match_scope(dog.text, ALL))
    assert not is_right(dog, match_scope("a person walks", ALL))


@pytest.mark.parametrize(
    ("prompt", "verdict", "action", "read_as"),
    [
        ("a person walks forward", "known", "walk", None),
        ("a man raises both his arms slowly", "known", "raise-arm", None),
        ("she sprints", "close", "sprint", "run"),
        ("a person roams", "close", "walk", "walk"),
        ("he kicks", "tried", "kick", None),
        ("a person climbs a ladder", "unknown", "climb-ladder", None),
        ("a person juggles", "unknown", None, None),
        ("is punching a bag", "tried", "punch", None),
        ("gets punched", "unknown", "flinch", None),
        ("jumps on a box", "unknown", "jump", None),
        ("picks the heavy box up", "unknown", "pick-up", None),
    ],
)
def test_verdicts_of_a_bundle_with_few_actions(
    prompt: str, verdict: str, action: str | None, read_as: str | None
) -> None:
    (named,) = match_scope(prompt, FEW).actions
    assert (named.verdict, named.action, named.read_as) == (verdict, action, read_as)


@pytest.mark.parametrize(
    ("prompt", "flag"),
    [
        ("he does not wave", "negation"),
        ("walks without moving the arms", "negation"),
        ("throws a ball", "objects"),
        ("a warrior swings a halberd", "objects"),
        ("throws another boomerang at the wall", "objects"),
        ("she lifts a big kettlebell", "objects"),
        ("carries the anvil to the forge", "objects"),
        ("opens the hatch", "objects"),
        ("picks up her gauntlet", "objects"),
        ("drinks three times", "counts"),
        ("drink x3", "counts"),
        ("squats 10", "counts"),
        ("does one throw", "counts"),
        ("a mermaid swims", "subject"),
        ("the lampshade slowly turns left", "subject"),
        ("walks w/o swinging the arms", "negation"),
        ("refrains from waving", "negation"),
        ("two people dance", "several-people"),
        ("the dog barks", "other-subject"),
        ("ein Mann läuft", "other-language"),
        ("an old man in a coat", "no-action"),
        ("asdf qwer zxcv", "gibberish"),
        ("she fails to stand up", "negation"),
        ("dont run", "negation"),
        ("crawls rather than walks", "negation"),
        ("a double throw", "counts"),
        ("a nurse and a doctor dance", "several-people"),
        ("the runners stop", "several-people"),
        ("a gang cheers", "several-people"),
        ("he lifts his brother", "several-people"),
        ("a guard pushes a tall thief away", "several-people"),
        ("a two person dance", "several-people"),
        ("everybody claps", "several-people"),
        ("they run arm in arm", "several-people"),
        ("a man is hugging his friend", "several-people"),
        ("walk 前に進む", "other-language"),
        ("she runs шагом", "other-language"),
        ("a kite waves", "other-subject"),
    ],
)
def test_flags(prompt: str, flag: str) -> None:
    assert flag in match_scope(prompt, ALL).flags


@pytest.mark.parametrize("prompt", ["lifts two hands", "a wave of the left hand", "he walks for 3 seconds", "..."])
def test_prompts_without_counts(prompt: str) -> None:
    assert "counts" not in match_scope(prompt, ALL).flags


@pytest.mark.parametrize(
    "prompt",
    [
        "a person walks like an old man",
        "someone imitates a boxer",
        "the walk of a zombie",
        "a man does a soldier crawl",
        "she bows to the audience",
        "he waves at a friend",
        "I need a guard who kneels",
        "a couple of steps to the left",
        "an audience member claps",
        "both hands circle each other",
        "punches an imaginary opponent",
        "jogging where she stands, a woman keeps her elbows bent",
        "she guards the door",
    ],
)
def test_one_person_is_no_several(prompt: str) -> None:
    assert "several-people" not in match_scope(prompt, ALL).flags


@pytest.mark.parametrize("prompt", ["three star jumps", "wave hands, no no", "wave arms in turn, right high"])
def test_the_noun_of_a_phrase_is_no_subject(prompt: str) -> None:
    assert match_scope(prompt, ALL).verdict == "known"


def test_words_of_another_script_leave_the_verdict_to_the_others() -> None:
    scope = match_scope("a person walks 前に", ALL)
    assert (scope.verdict, scope.flags) == ("known", ("other-language",))
    (warning,) = warn_of("a person walks 前に", "bundle", ALL)
    assert "words in another language are not read" in warning
    assert match_scope("a person walks to the café", ALL).flags == ()


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)])
def test_few_captions_of_one_person_are_flagged_as_of_several(every: int) -> None:
    """Captions of people who saw one figure: 1 in 300 is the words' doing."""
    captions = read_captions(REPOSITORY / "workers" / "marey" / "data" / "sets" / "cmu")
    assert len(captions) > 1000
    captions = captions[::every]
    flagged = [each for each in captions if "several-people" in match_scope(each, ALL).flags]
    assert len(flagged) < len(captions) / 100, flagged


def test_the_worst_action_is_the_verdict_of_a_prompt() -> None:
    scope = match_scope("he walks, kicks and juggles", FEW)
    assert [named.verdict for named in scope.actions] == ["known", "tried", "unknown"]
    assert scope.verdict == "unknown"


def test_a_prompt_without_an_action_has_one_unknown() -> None:
    assert match_scope("hmm", FEW).as_json() == {
        "version": 1,
        "by": "words",
        "verdict": "unknown",
        "actions": [{"text": "hmm", "verdict": "unknown"}],
        "flags": ["gibberish"],
    }


def test_a_single_take_is_known() -> None:
    assert match_scope("claps", ActionLists((), single_take=("clap",))).verdict == "known"
