"""File names come out plain, whatever goes in."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.cli.names import DEFAULT_TEMPLATE, FileNames, Naming, check_template, file_name, slug
from shared.errors import InvalidInput
from shared.items import NAME, read_item


def naming(name: str = "wave") -> Naming:
    return Naming(index=7, name=name, seed=41, variant=0, model="hgm3", job="j")


def test_the_default_name_sorts_and_tells_the_seed() -> None:
    assert file_name(DEFAULT_TEMPLATE, naming(), "bvh") == "00007_wave_41.bvh"


def test_no_two_motions_get_one_name_on_any_system() -> None:
    names = FileNames("{name}")
    assert [names.of(1, naming(), kind) for kind in ("npz", "bvh", "npz")] == ["wave.npz", "wave.bvh", "wave.npz"]
    with pytest.raises(InvalidInput, match=r"--name-template: two motions would be written to Wave\.npz"):
        names.of(2, naming("Wave"), "npz")


@given(st.text(max_size=200))
def test_any_prompt_makes_a_plain_slug(prompt: str) -> None:
    assert NAME.fullmatch(slug(prompt))
    assert len(slug(prompt)) <= 48


@pytest.mark.parametrize(
    "template", ["../{name}", "/tmp/{name}", "{name}/{seed}", "..", "{name}\\{seed}", ".{name}", "{", "{0}", "{name!x}",
                 "{home}", "{name.__class__}", "{tag}", "{tag[a.b]}", "{tag[a].x}", "{tags[0]}", "a:b", "con",
                 "{index:z}"],
)  # fmt: skip
def test_a_template_that_could_leave_the_folder_is_refused(template: str) -> None:
    with pytest.raises(InvalidInput, match="--name-template"):
        check_template(template)


@pytest.mark.parametrize(
    "name",
    ["../x", "/etc/passwd", "a/b", "a\\b", ".hidden", "-rf", "", "con", "NUL.txt", "a\0b", "a\nb", "x" * 101, "a."],
)
def test_a_name_with_path_tricks_is_refused(name: str) -> None:
    item, problems = read_item({"prompt": "a person waves", "name": name})
    assert item is None
    assert [p.field for p in problems] == ["name"]


@pytest.mark.parametrize(
    ("name", "why"), [("CON", "Windows keeps it for a device"), ("x" * 300, "has 300 characters"), ("Zoë", "use A-Z")]
)
def test_a_name_is_told_why_it_is_refused(name: str, why: str) -> None:
    _, (problem,) = read_item({"prompt": "a person waves", "name": name})
    assert why in problem.message


@given(st.text(alphabet="ab./\\: \0é-_", max_size=12))
def test_a_name_that_passes_stays_in_its_folder(name: str) -> None:
    item, _ = read_item({"prompt": "a person waves", "name": name})
    if item is not None and item.name is not None:
        made = file_name(DEFAULT_TEMPLATE, naming(item.name), "npz")
        assert "/" not in made
        assert "\\" not in made
        assert ".." not in made


def test_values_of_tags_stand_in_names_and_never_as_paths() -> None:
    of = Naming(index=7, name="wave", seed=41, variant=0, model="hgm3", job="j", tags=("shot=010", "hero", "take=../x"))
    assert file_name("{tag[shot]}_{name}", of, "npz") == "010_wave.npz"
    assert check_template("{tag[shot]}_{tags}") == "{tag[shot]}_{tags}"
    with pytest.raises(InvalidInput, match="no tag show="):
        file_name("{tag[show]}", of, "npz")
    for template in ("{tag[take]}", "a_{tags}"):
        with pytest.raises(InvalidInput, match="plain file name"):
            file_name(template, of, "npz")
