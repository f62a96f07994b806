"""Tables of prompts: delimiters, extra columns, and every problem at once with the line an editor shows."""

from __future__ import annotations

import gzip
import io
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.client.rows import read_file, right_items
from marey.client.tables import ExtraColumns, csv_rows, delimiter_of
from marey.items.item import COLUMNS, Item, Unreadable
from marey.items.problems import InvalidItems


def items(path: Path, extra: ExtraColumns = "refuse", **options: Any) -> list[Item]:
    return list(right_items(read_file(str(path), extra_columns=extra, **options)))


def read_lines(path: Path, extra: ExtraColumns = "refuse") -> list[str]:
    with pytest.raises(InvalidItems) as caught:
        items(path, extra)
    assert caught.value.where == str(path)
    return [str(problem) for problem in caught.value.problems]


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return tmp_path / "shots.csv"


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("head", ["prompt{0}seed{0}tags", '"prompt"{0}"seed"{0}"tags"', " prompt {0} seed{0}tags "])
def test_the_header_alone_tells_the_delimiter(table: Path, delimiter: str, head: str) -> None:
    row = delimiter.join(["walks, then; bows", "7", "a; b"])
    quoted = delimiter.join(['"walks, then; bows\t"', "7", '"a; b"'])
    table.write_text(f"{head.format(delimiter)}\n{quoted}\n")
    assert items(table) == [Item("walks, then; bows", seed=7, tags=("a", "b"))]
    if delimiter == "\t":
        table.write_text(f"{head.format(delimiter)}\n{row}\n")
        assert items(table) == [Item("walks, then; bows", seed=7, tags=("a", "b"))]


def test_a_single_column_is_split_by_commas_whatever_its_rows_hold(table: Path) -> None:
    table.write_text("prompt\nwalks; then bows\n")
    assert items(table) == [Item("walks; then bows")]
    assert delimiter_of("prompt", COLUMNS) == ","
    assert delimiter_of("who;what\n", COLUMNS) == ","


def test_stdin_tells_a_table_by_any_delimiter(monkeypatch: pytest.MonkeyPatch) -> None:
    class Stdin:
        buffer = io.BytesIO(b"seed;prompt\n3;a person walks\n")

    monkeypatch.setattr(sys, "stdin", Stdin)
    assert list(right_items(read_file("-"))) == [Item("a person walks", seed=3)]


def test_extra_columns_are_refused_become_tags_or_are_ignored(table: Path) -> None:
    table.write_text("prompt,Szene,tags,who\na person walks,3/4,day,Zoe\u0308\na person bows,,, \n")
    assert read_lines(table) == [
        f"line 1: {name!r} is not a known column; known columns are {', '.join(COLUMNS)}" for name in ("Szene", "who")
    ]
    assert [item.tags for item in items(table, "tag")] == [("day", "Szene=3/4", "who=Zoe\u0308"), ()]
    assert [item.tags for item in items(table, "ignore")] == [("day",), ()]
    with pytest.raises(InvalidItems, match="extra_columns tag or ignore"):
        items(table)


@pytest.mark.parametrize("header", ["Prompt,secnds", "Prompt;secnds", " PROMPT ;secnds"])
def test_a_column_that_is_nearly_known_is_told_with_the_known_one(table: Path, header: str) -> None:
    table.write_text(f"{header}\na person walks{header[-7]}3\n")
    prompt = header[:-7].strip()
    known = f"known columns are {', '.join(COLUMNS)}"
    assert read_lines(table) == [
        f"line 1: {prompt!r} is not a known column (did you mean 'prompt'?); {known}",
        f"line 1: 'secnds' is not a known column (did you mean 'seconds'?); {known}",
        f"line 1: prompt: is not among the columns of the first line; {known}",
    ]
    (problem,) = read_lines(table, "ignore")
    assert problem == f"line 1: prompt: is not among the columns of the first line (is {prompt!r} meant?); {known}"


def test_a_table_on_stdin_is_one_in_any_case(monkeypatch: pytest.MonkeyPatch) -> None:
    class Stdin:
        buffer = io.BytesIO(b"Prompt,seconds\na person walks,3\n")

    monkeypatch.setattr(sys, "stdin", Stdin)
    with pytest.raises(InvalidItems, match="'Prompt' is not a known column"):
        list(right_items(read_file("-")))


def test_tags_of_extra_columns_keep_the_limits_of_tags(table: Path) -> None:
    many = [f"c{n}" for n in range(21)]
    table.write_text(f"prompt,{','.join(many)}\na person walks{',x' * 21}\na person bows,{'y' * 70}\n")
    found = read_lines(table, "tag")
    assert found[0] == "line 2: tags: 21 tags are over the limit of 20"
    assert found[1].startswith("line 3: tags: 'c0=yyy")
    table.write_text("prompt,a=b,\na person walks,1,2\n")
    assert read_lines(table, "tag") == [
        f"line 1: {name!r} cannot be the key of a tag: give the column a name without =" for name in ("a=b", "")
    ]


def test_everything_is_told_in_one_pass_with_the_line_an_editor_shows(table: Path) -> None:
    text = (
        "\n"  # 1
        "prompt,seconds,colour\n"  # 2: unknown column
        '"a person\nwalks\n\nfar",2,red\n'  # 3 to 6
        "\n"  # 7
        ",1,\n"  # 8: no prompt
        '"a person\r\nbows",soon,\n'  # 9 to 10
        "a person \x1b[2Jruns,-1,\n"  # 11: two problems
        "a person hops,1,x,y\n"  # 12: too many cells
        '"a person never ends\n'  # 13: not closed
    )
    expected = [
        "line 2: 'colour' is not a known column",
        "line 8: prompt: the prompt is empty",
        "line 9: seconds: is 'soon', not a number",
        "line 11: prompt: the prompt holds the control character U+001B",
        "line 11: seconds: -1 is outside",
        "line 12: has 4 cells, the first line 3",
        "line 13: is not CSV: a quote is never closed",
    ]
    for content in (text.encode(), b"\xef\xbb\xbf" + text.encode()):
        for path, packed in ((table, content), (table.with_suffix(".csv.gz"), gzip.compress(content))):
            path.write_bytes(packed)
            assert [line[: len(start)] for line, start in zip(read_lines(path), expected, strict=True)] == expected


def test_a_byte_that_is_no_utf8_is_told_beside_what_came_before_it(table: Path) -> None:
    table.write_bytes(b"prompt\n\n\x1c\n" + b"a person walks\n" * 3 + b"a person b\xf6ws\n")
    found = read_lines(table)
    assert found[0].startswith("line 3: prompt: the prompt holds the control character U+001C")
    assert found[1].startswith("line 7: is not UTF-8 (byte 0xf6); the lines below it were not read")


def test_an_item_for_each_row_keeps_what_its_model_can_be_asked_about(table: Path) -> None:
    table.write_text("prompt,seconds,model,seed\n,12,,\na person walks,12,no such,\na person bows,12,,x\nok walk,3,,\n")
    reader = read_file(str(table))
    assert [(item.prompt, item.seconds) for item in reader] == [
        ("a person walks", 12.0),
        ("a person bows", 12.0),
        ("ok walk", 3.0),
    ]
    assert reader.lines == [2, 4, 5]
    assert reader.total == 3


@given(st.lists(st.tuples(st.text(max_size=8), st.sampled_from(["\n", "\r\n", "\r"])), max_size=8))
def test_lines_are_counted_whatever_the_cells_hold(cells: list[tuple[str, str]]) -> None:
    """A cell of any text, quoted, in a row of its own: each row is told at the line where it begins."""
    import io

    text, expected = "prompt\n", []
    for cell, end in cells:
        expected.append(1 + len(io.StringIO(text, newline="").readlines()))
        quoted = '"{}"'.format(cell.replace('"', '""'))
        text += f"{quoted}x{end}"  # a letter behind the quote: never blank, never valid in strict CSV
    lines = enumerate(io.StringIO(text, newline=""), 1)
    found = [(line, row) for line, row in csv_rows(lines, COLUMNS)]
    assert [line for line, _ in found] == expected[: len(found)]
    assert all(isinstance(row, Unreadable) for _, row in found)
