"""Actions read in prompts in ordinary phrasing."""

from marey.checks.action_prompts import ReadingPrompt, ReadingSet, kind_prompts, reading_prompts
from marey.selector import wanted_of
from marey.vocabulary.counts import stated_count
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import ActionLists, match_scope
from tests.support.marey import REPOSITORY


def read(text: str) -> set[str]:
    """Return the actions with which a motion of a prompt is matched."""
    return {wanted.action for step in wanted_of([text]) or () for wanted in step}


def flags_of(text: str, lists: ActionLists) -> frozenset[str]:
    """Return the flags of a prompt, and `counts` where its number is read and kept."""
    scope = match_scope(text, lists)
    kept = any(load_vocabulary().need(name).counted and stated_count(text, name) for name in read(text))
    return frozenset([*scope.flags, *(["counts"] if kept else [])])


def test_the_published_counts_are_those_of_the_sets() -> None:
    page = (REPOSITORY / "docs" / "reference" / "scope.md").read_text()
    counts: dict[ReadingSet, int] = {"development": 124, "held_out": 120}
    for which, before in counts.items():
        prompts = reading_prompts(which)
        right = sum(prompt.is_right(read(prompt.text)) for prompt in prompts)
        assert f"| {len(prompts)} | {before}, {right} |" in page


def test_the_published_counts_of_all_kinds_are_those_of_the_halves() -> None:
    page = (REPOSITORY / "docs" / "reference" / "scope.md").read_text()
    row = next(line for line in page.splitlines() if line.startswith("| all | 124"))
    every = ActionLists(tuple(load_vocabulary().actions))
    cells = [cell.strip().split(", ")[-1] for cell in row.split("|")[2:-1]]
    for which, (count, right, flagged) in zip(("development", "held_out"), (cells[:3], cells[3:]), strict=True):
        prompts = [prompt for kind in kind_prompts(which).values() for prompt in kind]
        wanted = [[each.action for step in wanted_of([prompt.text]) or () for each in step] for prompt in prompts]
        ordered = [one.is_right(set(read)) and one.is_ordered(read) for one, read in zip(prompts, wanted, strict=True)]
        flags = [prompt.is_flagged(flags_of(prompt.text, every)) for prompt in prompts]
        assert [len(prompts), sum(ordered), sum(flags)] == [int(count), int(right), int(flagged)]


def test_a_prompt_is_judged_by_sides_order_and_flags() -> None:
    prompt = ReadingPrompt(
        "", (frozenset({"kick"}), frozenset({"bow"})), frozenset(), ("left", ""), frozenset({"counts"}), frozenset()
    )
    assert prompt.has_sides({"kick": "left", "bow": ""})
    assert not prompt.has_sides({"kick": "", "bow": ""})
    assert prompt.is_ordered(["kick", "bow"])
    assert not prompt.is_ordered(["bow", "kick"])
    assert prompt.is_flagged({"counts", "length"})
    assert not prompt.is_flagged(set())
    assert not prompt.is_flagged({"counts", "negation"})


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
