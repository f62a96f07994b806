"""Files of prompts: what is read, and what is said about what cannot be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.client.rows import (
    defaults_of,
    read_arguments,
    read_evaluation_prompts,
    read_file,
    read_rows,
    read_timelines,
    right_items,
)
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.items.evaluation_prompts import EvaluationPrompt
from marey.items.item import Item
from marey.items.problems import InvalidItems, OutOfScope, Problem
from tests.support.models import NOT_KEEPING
from tests.support.rows import items_of


def write(folder: Path, name: str, content: str | bytes) -> str:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return str(path)


def problems(folder: Path, name: str, content: str | bytes) -> list[str]:
    with pytest.raises(InvalidItems) as caught:
        items_of(write(folder, name, content))
    return [str(problem) for problem in caught.value.problems]


def test_a_csv_gives_every_column_its_type(tmp_path: Path) -> None:
    header = "prompt,name,seconds,seed,variants,model,tags\n"
    text = header + '"walks, then runs",a,2.5,7,3,hgm3,walk; run\na person waves,,,,,,\n'
    assert items_of(write(tmp_path, "p.csv", text)) == [
        Item("walks, then runs", "a", 2.5, ("walk", "run"), 7, 3, "hgm3"),
        Item("a person waves"),
    ]


@pytest.mark.parametrize("bom", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("newline", [b"\n", b"\r\n"])
def test_a_byte_order_mark_and_windows_lines_change_nothing(tmp_path: Path, bom: bytes, newline: bytes) -> None:
    path = write(tmp_path, "p.csv", bom + newline.join([b"prompt,seed", b"a person waves,3", b""]))
    assert items_of(path) == [Item("a person waves", seed=3)]


def test_a_jsonl_line_may_hold_settings(tmp_path: Path) -> None:
    path = write(tmp_path, "p.jsonl", '{"prompt": "a person waves", "settings": {"guidance": 3}}\n\n')
    assert items_of(path) == [Item("a person waves", settings={"guidance": 3.0})]


def test_a_csv_has_a_column_of_settings_which_come_before_those_of_the_command(tmp_path: Path) -> None:
    path = write(tmp_path, "p.csv", "prompt,settings\na person waves,temperature=1.2; guidance=4\na person bows,\n")
    assert [item.settings for item in items_of(path)] == [{"temperature": 1.2, "guidance": 4.0}, {}]
    defaults = defaults_of(settings={"guidance": 2.0, "steps": 8.0}, fps=30.0)
    assert [item.settings for item in items_of(path, defaults=defaults)] == [
        {"temperature": 1.2, "guidance": 4.0, "steps": 8.0, "fps": 30.0},
        {"guidance": 2.0, "steps": 8.0, "fps": 30.0},
    ]


def test_a_column_of_timelines_stands_for_that_of_prompts(tmp_path: Path) -> None:
    rows = "0-3 a person walks; 3-5 a person waves"
    path = write(tmp_path, "p.csv", f'prompt,timeline,tags\n,"{rows}",a\na person bows,,\n')
    first, second = items_of(path, defaults=defaults_of(seconds=4.0))
    assert (first.prompt, first.seconds, first.tags) == (rows, None, ("a",))
    assert first.timeline is not None
    assert (second.timeline, second.seconds) == (None, 4.0)
    (alone,) = items_of(write(tmp_path, "q.csv", f"timeline\n{rows}\n"))
    assert alone.timeline == first.timeline
    assert problems(tmp_path, "r.csv", f"prompt,timeline\nbow,{rows}\n") == [
        "line 2: prompt: stands beside a timeline: give one of the two"
    ]


def test_a_timeline_of_jsonl_has_rows_or_a_text(tmp_path: Path) -> None:
    lines = '{"timeline": [{"start": 0, "end": 3, "prompt": "walk"}]}\n{"timeline": "0-3 walk", "model": "hgm3"}\n'
    first, second = items_of(write(tmp_path, "p.jsonl", lines))
    assert first.timeline == second.timeline == [{"start": 0.0, "end": 3.0, "prompt": "walk"}]
    assert problems(tmp_path, "q.jsonl", f'{{"timeline": "0-3 walk", "model": "{NOT_KEEPING}"}}\n') == [
        f"line 1: timeline: the model {NOT_KEEPING!r} cannot generate timelines: it makes no motion between other "
        "frames. Choose a bundle of the default model, or submit each row as a prompt."
    ]


@pytest.mark.parametrize("cell", ["hot", "guidance=", "guidance=high", "guidance=nan", "Guidance=2", "a=1;a=2", "=3"])
def test_settings_that_are_none_are_told_with_their_line(tmp_path: Path, cell: str) -> None:
    (problem,) = problems(tmp_path, "p.csv", f"prompt,settings\na person waves,{cell}\n")
    assert problem.startswith("line 2: settings: ")
    assert "write guidance=4.5;temperature=0.8" in problem


def test_a_setting_that_is_no_number_is_named(tmp_path: Path) -> None:
    (problem,) = problems(tmp_path, "p.csv", "prompt,settings\na person waves,guidance=4;top_k=high\n")
    assert problem == "line 2: settings: top_k: 'high' is not a number; write guidance=4.5;temperature=0.8"
    (problem,) = problems(tmp_path, "p.jsonl", '{"prompt": "a person waves", "settings": "guidance=4"}\n')
    assert problem == 'line 1: settings: is not an object: write {"guidance": 4.5}'


def test_a_field_that_is_nearly_known_is_told_with_the_known_one(tmp_path: Path) -> None:
    found = problems(tmp_path, "p.jsonl", '{"Prompt": "a person waves", "secnds": 3}\n')
    assert [problem.partition(";")[0] for problem in found] == [
        "line 1: Prompt: is not a known field (did you mean 'prompt'?)",
        "line 1: secnds: is not a known field (did you mean 'seconds'?)",
        "line 1: prompt: is missing: say what the person does",
    ]
    row = '{"start": 0, "end": 3, "promt": "walk"}'
    (problem,) = problems(tmp_path, "p.jsonl", f'{{"timeline": [{row}]}}\n')
    assert "row 1: 'promt' is not a known field (did you mean 'prompt'?)" in problem
    constraint = '{"type": "root_path", "frame": [0]}'
    (problem,) = problems(tmp_path, "p.jsonl", f'{{"prompt": "walk", "constraints": [{constraint}]}}\n')
    assert "frame: unknown field of 'root_path' (did you mean 'frames'?)" in problem


def test_a_line_that_is_no_json_is_told_with_the_place_in_it(tmp_path: Path) -> None:
    (problem,) = problems(tmp_path, "p.jsonl", '{"prompt": "a person waves"}\n{bad\n')
    assert problem == "line 2: is not JSON: Expecting property name enclosed in double quotes at character 2"


def test_a_text_file_is_a_prompt_a_line(tmp_path: Path) -> None:
    path = write(tmp_path, "p.txt", "a person waves\n\n  a person   bows \r\n")
    assert [item.prompt for item in items_of(path)] == ["a person waves", "a person bows"]


def test_an_unknown_column_is_an_error_that_lists_the_known_ones(tmp_path: Path) -> None:
    found = problems(tmp_path, "p.csv", "prompt,duration\na person waves,3\n")
    assert found == [
        "line 1: 'duration' is not a known column; known columns are prompt, name, seconds, seed, variants, model, "
        "tags, settings, variety, timeline, constraints"
    ]


def test_every_problem_is_told_with_its_line(tmp_path: Path) -> None:
    text = 'prompt,seconds,seed\na person waves,2,1\n,2,1\n"a person\nbows",long,1\na person runs,0.1,-1\na,b,c,d\n'
    assert [line.split(":")[:2] for line in problems(tmp_path, "p.csv", text)] == [
        ["line 3", " prompt"],
        ["line 4", " seconds"],
        ["line 6", " seconds"],
        ["line 6", " seed"],
        ["line 7", " has 4 cells, the first line 3"],
    ]


def test_one_bad_line_among_a_thousand_is_found(tmp_path: Path) -> None:
    lines = [f"a person waves {i} times" for i in range(1000)]
    lines[5] = "a person\0waves"
    assert problems(tmp_path, "p.csv", "\n".join(["prompt", *lines])) == [
        "line 7: prompt: the prompt holds a NUL byte. Is the file plain UTF-8 text?"
    ]


def test_broken_json_is_told_with_its_line_and_the_rest_is_still_read(tmp_path: Path) -> None:
    found = problems(
        tmp_path, "p.jsonl", '{"prompt": "a person waves"}\n{"prompt": \n[1]\n{"prompt": "bows", "speed": 2}\n'
    )
    assert [line.split(":")[0] for line in found] == ["line 2", "line 3", "line 4"]
    assert "speed: is not a known field (did you mean 'seed'?); known: prompt," in found[2]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("prompt\na person waves".encode("utf-16"), "UTF-16"),
        (b"prompt\na person waves\ngar\xe7on waves\n", "line 3: is not UTF-8"),
    ],
)
def test_a_file_in_another_encoding_is_refused_with_what_to_do(tmp_path: Path, content: bytes, said: str) -> None:
    with pytest.raises(InvalidFile, match=said) as caught:
        items_of(write(tmp_path, "p.csv", content))
    assert caught.value.hint is not None
    assert "UTF-8" in caught.value.hint


def test_a_csv_that_breaks_off_inside_a_quote_names_the_line(tmp_path: Path) -> None:
    assert problems(tmp_path, "p.csv", 'prompt\na person waves\n"a person bows')[0].startswith("line 3: is not CSV")


def test_a_file_that_is_not_there_or_tells_no_format_or_holds_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NotFound):
        items_of(str(tmp_path / "none.csv"))
    with pytest.raises(InvalidInput, match="ending"):
        items_of(write(tmp_path, "prompts.xlsx", "a"))
    with pytest.raises(InvalidInput, match="no prompt"):
        items_of(write(tmp_path, "p.csv", "prompt\n"))


def test_options_of_the_command_stand_in_where_a_line_says_nothing(tmp_path: Path) -> None:
    defaults = defaults_of(seconds=4.0, seed=1, variants=3, model="hgm3", bundle="hgm3-starter", fps=30.0)
    lines = [
        '{"prompt": "a person bows"}',
        '{"prompt": "a person waves", "seconds": 2, "seed": 0, "variants": 1, "model": "stroller", '
        '"settings": {"fps": 60}}',
        '{"prompt": "a person walks", "seconds": null, "settings": {"guidance": 3}}',
    ]
    assert items_of(write(tmp_path, "p.jsonl", "\n".join(lines)), defaults=defaults) == [
        Item("a person bows", None, 4.0, (), 1, 3, "hgm3-starter", {"fps": 30.0}),
        Item("a person waves", None, 2.0, (), 0, 1, "stroller", {"fps": 60.0}),
        Item("a person walks", None, 4.0, (), 1, 3, "hgm3-starter", {"fps": 30.0, "guidance": 3.0}),
    ]
    table = write(tmp_path, "p.csv", "prompt,variants,seed\na person bows,1,\na person waves,,9\n")
    found = [(item.variants, item.seed) for item in items_of(table, defaults=defaults)]
    assert found == [(1, 1), (3, 9)]
    assert [item.variants for item in right_items(read_arguments(["a person bows"], defaults))] == [3]


def test_tags_of_the_command_come_beside_those_of_a_line(tmp_path: Path) -> None:
    defaults = defaults_of(tags=["shot=010", "walk"])
    table = write(tmp_path, "p.csv", "prompt,tags\na person walks,walk; take 2\na person bows,\n")
    found = [item.tags for item in items_of(table, defaults=defaults)]
    assert found == [("walk", "take 2", "shot=010"), ("shot=010", "walk")]
    assert [item.tags for item in right_items(read_arguments(["a person bows"], defaults))] == [("shot=010", "walk")]
    for wrong in ("3", "[{}]"):
        line = f'{{"prompt": "a person bows", "tags": {wrong}}}'
        with pytest.raises(InvalidItems, match="tags"):
            items_of(write(tmp_path, "p.jsonl", line), defaults=defaults)


@pytest.mark.parametrize(
    ("argument", "given", "said"),
    [
        ("tags", {"tags": ["take\n2"]}, "is not a tag"),
        ("variants", {"variants": 0}, "0 is outside 1 to 100"),
        ("variants", {"variants": 101}, "101 is outside 1 to 100"),
        ("seconds", {"seconds": 1000.0}, r"1000 is outside 0\.5 to 60"),
        ("seed", {"seed": -1}, "-1 is outside 0"),
        ("fps", {"fps": 0.0}, "0 is outside 1 to 240"),
        ("bundle", {"model": "hgm3", "bundle": "no such"}, "'no such' is not the name"),
    ],
)
def test_a_default_that_no_row_could_have_is_refused_by_the_name_of_its_argument(
    argument: str, given: dict[str, Any], said: str
) -> None:
    with pytest.raises(InvalidInput, match=said) as caught:
        defaults_of(**given)
    assert (caught.value.where, caught.value.argument) == (argument, argument)


@given(st.binary(max_size=300), st.sampled_from(["csv", "jsonl", "txt"]))
def test_no_file_breaks_the_reader(tmp_path_factory: pytest.TempPathFactory, content: bytes, ending: str) -> None:
    path = tmp_path_factory.getbasetemp() / f"any.{ending}"
    path.write_bytes(content)
    try:
        items = items_of(str(path))
    except InvalidInput:
        return
    assert items


def test_a_file_of_an_evaluation_has_columns_of_its_own(tmp_path: Path) -> None:
    text = 'prompt,seconds,expected\n"walks, then waves",2.5,walk then wave left\na person runs,,\n'
    assert read_evaluation_prompts(write(tmp_path, "p.csv", text))[0] == (
        EvaluationPrompt("walks, then waves", 2.5, "walk then wave left"),
        EvaluationPrompt("a person runs"),
    )
    lines = '{"prompt": "a person walks", "expected": "Walk  straight"}\n\n{"prompt": "a person runs"}\n'
    assert read_evaluation_prompts(write(tmp_path, "p.jsonl", lines))[0] == (
        EvaluationPrompt("a person walks", expected="walk straight"),
        EvaluationPrompt("a person runs"),
    )


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "no prompt"),
        ("prompt,seconds\n", "no prompt"),
        ("prompt\na person walks\n", "more than one prompt"),
        ("prompt,tags\na person walks,x\n", "known columns are prompt, seconds, expected"),
        ("prompt,seconds\na person walks,soon\na person runs,-1\n", "line 2: seconds"),
        ("prompt,seconds\na person walks,soon\na person runs,-1\n", "line 3: seconds"),
        ("prompt,expected\na person walks,fly\na person runs,\n", "line 2: expected: 'fly' is not an act"),
    ],
)
def test_a_file_of_an_evaluation_that_cannot_be_used_says_why(tmp_path: Path, content: str, said: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        read_evaluation_prompts(write(tmp_path, "p.csv", content))[0]
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("given", "where", "message"),
    [
        ({"best_of": 9, "redraws": 1}, "best_of", "9 is outside 1 to 8"),
        ({"best_of": 2, "redraws": 7}, "redraws", "7 is outside 0 to 2"),
        ({"fps": 0.5, "settings": {"guidance": 4.0}}, "fps", "0.5 is outside 1 to 240"),
        ({"fps": 30, "settings": {"redraws": 7}}, "settings", "redraws: 7 is outside 0 to 2"),
    ],
)
def test_an_argument_that_is_a_setting_is_named_once(given: dict[str, Any], where: str, message: str) -> None:
    with pytest.raises(InvalidInput) as told:
        defaults_of(**given)
    assert (told.value.where, told.value.argument, told.value.message) == (where, where, message)


def test_a_problem_counts_lines_arguments_or_rows(tmp_path: Path) -> None:
    file = write(tmp_path, "p.txt", f"a person walks\n\n{'a' * 101}\n")
    for reader, unit, number in (
        (read_file(file), "line", 3),
        (read_arguments(["a person walks", ""]), "argument", 2),
        (read_timelines(["0-3 a person walks", "walk"]), "argument", 2),
        (read_rows([{"prompt": "a person walks"}, {"prompt": ""}]), "row", 2),
    ):
        list(reader)
        assert f"\n  {unit} {number}: " in str(reader.error())
        with pytest.raises(OutOfScope, match=f"\n  {unit} 1: prompt: is unknown"), reader.in_source():
            raise OutOfScope([Problem(1, "prompt", "is unknown")], hint="No.")
