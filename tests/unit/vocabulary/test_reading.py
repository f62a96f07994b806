"""Actions read in prompts in ordinary phrasing."""

from marey.checks.action_prompts import ReadingPrompt, ReadingSet, reading_prompts
from marey.selector import wanted_of
from marey.vocabulary.entries import load_vocabulary
from tests.support.marey import REPOSITORY


def read(text: str) -> set[str]:
    """Return the actions with which a motion of a prompt is matched."""
    return {wanted.action for step in wanted_of([text]) or () for wanted in step}


def test_the_published_counts_are_those_of_the_sets() -> None:
    page = (REPOSITORY / "docs" / "reference" / "scope.md").read_text()
    counts: dict[ReadingSet, int] = {"development": 124, "held_out": 120}
    for which, before in counts.items():
        prompts = reading_prompts(which)
        right = sum(prompt.is_right(read(prompt.text)) for prompt in prompts)
        assert f"| {len(prompts)} | {before}, {right} |" in page


def test_every_action_is_asked_for_by_one_of_its_prompts() -> None:
    prompts = [*reading_prompts("development"), *reading_prompts("held_out")]
    assert {name for prompt in prompts for each in prompt.asked for name in each} == set(load_vocabulary().actions)
    assert {name for prompt in prompts for name in prompt.beside} <= set(load_vocabulary().actions)


def test_a_prompt_is_read_right_with_all_that_it_asks_for_and_no_more() -> None:
    prompt = ReadingPrompt("", (frozenset({"walk"}), frozenset({"wave", "guide"})), frozenset({"bow"}))
    assert prompt.is_right(read("she walks and waves"))
    assert prompt.is_right(read("she walks, waves and bows"))
    assert not prompt.is_right(read("she walks"))
    assert not prompt.is_right(read("she walks, waves and kneels"))
