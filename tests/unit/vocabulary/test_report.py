"""Report on the scope of many prompts."""

from dataclasses import replace

from marey.vocabulary.report import MAX_EXAMPLES, MAX_NAMED, MAX_SHOWN, ScopeReport, refusal, says_known, warn_of
from marey.vocabulary.scope import ActionLists, match_scope, read_scope

LISTS = ActionLists(supported=("walk", "run", "walk-backward"), tried=("kick",))


def report_of(*prompts: str) -> ScopeReport:
    report = ScopeReport()
    for prompt in prompts:
        report.judge(prompt, "tiny", LISTS)
    return report


def test_a_single_prompt_is_warned_of_with_what_the_bundle_knows() -> None:
    lists = ActionLists(("walk",))
    (warning,) = warn_of("asdf qwer zxcv", "tiny", lists)
    assert warning.endswith("the motion is arbitrary. tiny knows: walk.")
    assert warn_of("a person walks", "tiny", lists) == []
    assert warn_of("asdf qwer zxcv", "tiny", None) == []


def test_nonsense_is_answered_with_what_the_model_knows() -> None:
    (warning,) = report_of("asdf qwer zxcv").warnings()
    assert warning == (
        "'asdf qwer zxcv': no action that the model knows; the motion is arbitrary. "
        "tiny knows: walk, run, walk backward."
    )


def test_known_prompts_are_counted_without_a_warning() -> None:
    report = report_of("a person walks", "she runs")
    assert report.warnings() == []
    assert report.as_json() == {
        "by": "words", "known": 2, "close": 0, "tried": 0, "unknown": 0, "unlisted": 0, "flags": {}, "examples": [],
        "actions": {},
    }  # fmt: skip


def test_every_verdict_and_flag_has_its_sentence() -> None:
    found = report_of("a person walks", "he kicks", "she sprints", "he walks, not runs", "runs twice").warnings()
    assert found == [
        "1 of 5 prompts, index 1 (from 0), 'he kicks' (kick): named actions are unreliable with this model",
        "1 of 5 prompts, index 2 (from 0), 'she sprints' (run): read as another action",
        "1 of 5 prompts, index 3 (from 0), 'he walks, not runs': what is not to be done may be done",
        "1 of 5 prompts, index 4 (from 0), 'runs twice': may be done another number of times",
    ]


def test_a_warning_says_that_a_prompt_is_in_another_language_or_of_another_subject() -> None:
    found = report_of("a person walks", "ein Mann geht nach links", "un homme marche", "the dog barks").warnings()
    assert found[0].startswith("3 of 4 prompts, indexes 1, 2, 3 (from 0), first 'ein Mann geht nach links': no action")
    assert found[1:] == [
        "2 of 4 prompts, indexes 1, 2 (from 0), first 'ein Mann geht nach links': "
        "words in another language are not read: write in English",
        "1 of 4 prompts, index 3 (from 0), 'the dog barks': a person is shown in place of its subject",
    ]


def test_the_report_is_bounded() -> None:
    report = report_of(*["qqqqqq " * 100] * 50)
    assert report.warnings()[0].startswith(
        "50 of 50 prompts, indexes 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, … (from 0), first 'qq"
    )
    examples = report.as_json()["examples"]
    assert [example["kind"] for example in examples] == ["unknown"] * MAX_EXAMPLES
    assert max(len(example["prompt"]) for example in examples) == MAX_SHOWN
    assert [example["index"] for example in examples] == [0, 1, 2]
    assert (report.as_json()["unknown"], report.as_json()["flags"]) == (50, {"gibberish": 50})


def test_a_bundle_without_lists_has_no_verdicts() -> None:
    report = ScopeReport()
    assert report.judge("asdf", "tiny", None) is None
    assert (report.unlisted, report.warnings()) == (1, [])


def test_many_actions_are_named_in_part() -> None:
    said = says_known("tiny", [f"action-{number}" for number in range(MAX_NAMED + 2)])
    assert "action 19 and 2 more (`marey models show tiny`)." in said
    assert "action 20" not in said


def test_a_refusal_quotes_what_is_unknown() -> None:
    assert refusal(match_scope("he walks and juggles", LISTS)) == (
        "names an action that the model does not know: 'juggles'"
    )
    assert refusal(match_scope("the dog barks", LISTS)) == (
        "names an action that the model does not know: 'the dog barks' (objects, other-subject)"
    )
    assert refusal(match_scope("he kicks, then sprints", LISTS)) is None


def test_a_timeline_is_counted_once_and_the_row_is_named() -> None:
    report = ScopeReport()
    rows = [("row 1 (0-3)", "a person walks"), ("row 2 (3-5)", "he juggles"), ("row 3 (5-9)", "kicks twice")]
    scope = report.judge("0-3 a person walks; …", "tiny", LISTS, lengths=(1.0, 9.8), rows=rows)
    assert scope is not None
    assert (scope.verdict, [row.verdict for row in scope.rows]) == ("unknown", ["known", "unknown", "tried"])
    assert read_scope(scope.as_json()).rows == tuple(replace(row, left=None) for row in scope.rows)
    report.judge("he kicks", "tiny", LISTS)
    counts = report.as_json()
    assert (counts["unknown"], counts["tried"], counts["known"]) == (1, 1, 0)
    first, *_ = report.warnings()
    assert first.startswith("1 of 2 prompts, index 0 (from 0), 'row 2 (3-5): he juggles'")
    assert [(each["index"], each["kind"]) for each in counts["examples"]] == [(0, "unknown"), (1, "tried")]
