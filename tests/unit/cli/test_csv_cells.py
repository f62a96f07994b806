"""Formulas of spreadsheets are stored in a CSV as text, and read back unchanged."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.client import manifest
from marey.client.csv_cells import join_tags, protect, restore, split_tags, write_csv
from marey.client.manifest import COLUMNS, NAME, NUMBERS, RAW_COLUMNS, row_of, write_manifest
from marey.core.characters import find_forbidden
from marey.core.errors import Conflict
from marey.items.item import Item, read_item
from tests.support.rows import items_of

TEXT = st.text(st.one_of(st.sampled_from("=+-@\t\r\n'\",;x "), st.characters(exclude_categories=["Cs"])), max_size=20)
FORMULAS = ("=", "+", "-", "@", "\t", "\r")


@given(TEXT)
def test_no_cell_begins_like_a_formula_and_each_comes_back(text: str) -> None:
    cell = protect(text)
    assert not cell.startswith(FORMULAS)
    assert restore(cell) == text
    assert cell in (text, f"'{text}")


def test_only_text_that_needs_it_is_changed() -> None:
    for text in ("", "walk", "'tis", "''", "a=b", "1-2", " =1"):
        assert protect(text) == restore(text) == text
    for text, cell in (("=1+1", "'=1+1"), ("'=1", "''=1"), ("''@x", "'''@x"), ("-5", "'-5"), ("\tx", "'\tx")):
        assert (protect(text), restore(cell)) == (cell, text)


NUMBERS_AND_TEXT = st.one_of(TEXT, st.integers().map(str), st.floats(allow_nan=False, allow_infinity=False).map(str))


@given(st.lists(st.fixed_dictionaries({"text": TEXT, "number": NUMBERS_AND_TEXT}), max_size=5))
def test_a_file_comes_back_and_its_numbers_stay_numbers(rows: list[dict[str, str]]) -> None:
    content = write_csv(("text", "number"), rows, numbers={"number"})
    cells = list(csv.DictReader(io.StringIO(content.decode(), newline=""), strict=True))
    assert [{name: restore(cell) for name, cell in row.items()} for row in cells] == rows
    for row in cells:
        for cell in row.values():
            assert not cell.startswith(FORMULAS) or float(cell) is not None
        if row["number"].lstrip("-").isascii() and row["number"].lstrip("-").isdecimal():
            assert int(row["number"]) is not None


@given(st.lists(TEXT.filter(lambda tag: tag.strip() and not set(tag) & set("\r\n")), max_size=6))
def test_tags_come_back_whatever_is_in_them(tags: list[str]) -> None:
    assert split_tags(join_tags(tags)) == tags


def item(index: int, **values: Any) -> dict[str, Any]:
    """An item of the API."""
    return {
        "id": f"item-{index}", "job": "job", "index": index, "variant": 0, "name": None, "prompt": "a person walks",
        "model": "hgm3", "bundle": "hgm3-x@0123456789ab", "seed": 5, "seconds": None, "tags": [], "state": "succeeded",
        "error": None, "replaces": None, "motion": None, **values,
    }  # fmt: skip


PROMPTS = st.text(st.one_of(st.sampled_from("=+-@'walk \",;"), st.characters()), max_size=30).map(lambda t: f"{t} walk")


@given(
    prompts=st.lists(PROMPTS, min_size=1, max_size=5),
    tags=st.lists(TEXT, max_size=3),
    seconds=st.one_of(st.none(), st.floats(0.8, 9.8)),
)
def test_a_manifest_submitted_again_asks_for_the_same(
    tmp_path_factory: pytest.TempPathFactory, prompts: list[str], tags: list[str], seconds: float | None
) -> None:
    wanted = [
        found
        for number, prompt in enumerate(prompts)
        if (found := read_item({"prompt": prompt, "tags": tags, "seed": number, "seconds": seconds, "model": "hgm3",
                                "name": f"Zoë {number}"})[0])
    ]  # fmt: skip
    if not wanted:
        return
    folder = tmp_path_factory.mktemp("clips")
    rows = [row_of(item(number, **{"tags": [], **each.as_json()}), {}) for number, each in enumerate(wanted)]
    write_manifest(
        folder, "job", [{**row, "tags": join_tags(each.tags)} for row, each in zip(rows, wanted, strict=True)]
    )
    assert items_of(str(folder / NAME)) == wanted


@pytest.mark.parametrize(
    ("flags", "cell"), [(None, ""), ([], "ok"), (["floating", "skating"], "floating; skating")], ids=str
)
def test_the_quality_of_a_motion_is_a_cell(flags: list[str] | None, cell: str) -> None:
    quality = None if flags is None else {"flags": flags}
    assert row_of(item(0, motion={"id": "m0", "quality": quality}), {})["quality"] == cell
    assert row_of(item(0), {})["quality"] == ""


BEFORE = (
    "index,name,tags,prompt,seed,state,review,npz,bvh,licence,variant,model,bundle,frames,fps,error,comment,replaces,"
    "motion,item,job\r\n"
    "0,walk,shot=010; day,'=walks and runs,7,succeeded,kept,00000_walk_7.npz,00000_walk_7.bvh,CC-BY-4.0,0,hgm3,"
    "hgm3-x@0123456789ab,60,20.0,,=HYPERLINK(1),,m0,item-0,job\r\n"
    "1,,,-walks,8,failed,,,,,0,hgm3,hgm3-x@0123456789ab,,,out of memory,,,,item-1,job\r\n"
)
"""As the release before wrote it: no `seconds`, and every cell as it is."""


def test_a_manifest_of_the_release_before_is_read_as_it_is_and_carried_on(tmp_path: Path) -> None:
    path = tmp_path / NAME
    path.write_bytes(BEFORE.encode())
    assert items_of(str(path)) == [
        Item("'=walks and runs", "walk", seed=7, model="hgm3", tags=("shot=010", "day")),
        Item("-walks", seed=8, model="hgm3"),
    ]
    (tmp_path / "00000_walk_7.npz").write_bytes(b"npz")
    (tmp_path / "00000_walk_7.bvh").write_bytes(b"bvh")
    before = manifest._read(path)
    assert [row["comment"] for row in before] == ["=HYPERLINK(1)", ""]
    left = write_manifest(tmp_path, "job", before)
    assert left == []
    assert manifest._read(path) == before
    text = path.read_bytes().decode()
    assert text.count("\r\n") == 3
    assert ",''=walks and runs," in text
    assert ",'=HYPERLINK(1)," in text


def test_the_columns_tell_which_release_wrote_a_manifest() -> None:
    assert COLUMNS[: len(RAW_COLUMNS)] == RAW_COLUMNS
    assert COLUMNS != RAW_COLUMNS
    assert set(COLUMNS) > NUMBERS
    assert find_forbidden("".join(COLUMNS)) is None


def test_a_manifest_has_a_column_of_each_other_format_that_there_is(tmp_path: Path) -> None:
    folder = tmp_path / "clips"
    folder.mkdir()
    files = {"npz": "walk.npz", "usd": "walk.usd", "seed": "walk.seed"}  # a format may have the name of a column
    with_usd, without = row_of(item(0, seed=7), files), row_of(item(1), {"npz": "bow.npz"})
    assert (with_usd["seed"], with_usd["file:usd"], with_usd["file:seed"]) == ("7", "walk.usd", "walk.seed")
    assert write_manifest(folder, "job", [with_usd, without]) == []
    first = (folder / NAME).read_text().splitlines()[0]
    assert first == ",".join((*COLUMNS, "file:seed", "file:usd"))
    assert [row["file:usd"] for row in manifest._read(folder / NAME)] == ["walk.usd", ""]
    assert len(items_of(str(folder / NAME))) == 2  # it is still ours to submit again
    for name in files.values():
        (folder / name).write_text("clip")
    left = write_manifest(folder, "job", [without])
    assert sorted(path.name for path in left) == ["walk.npz", "walk.seed", "walk.usd"]
    assert (folder / NAME).read_text().splitlines()[0] == ",".join(COLUMNS)


def test_a_manifest_with_columns_of_somebody_else_is_not_ours(tmp_path: Path) -> None:
    (tmp_path / NAME).write_text(",".join((*COLUMNS, "notes")) + "\n")
    with pytest.raises(Conflict):
        write_manifest(tmp_path, "job", [])
