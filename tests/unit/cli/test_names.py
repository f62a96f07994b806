"""File names come out plain, whatever goes in."""

from __future__ import annotations

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.client.names import (
    DEFAULT_TEMPLATE,
    FileNames,
    Naming,
    check_template,
    file_name,
    safe_component,
    slug,
)
from marey.core.characters import find_forbidden
from marey.core.errors import InvalidInput
from marey.items.item import read_item
from marey.items.values import NAME, RESERVED


def naming(name: str = "wave") -> Naming:
    return Naming(index=7, name=name, seed=41, variant=0, model="hgm3", job="j")


def test_the_default_name_sorts_and_tells_the_seed() -> None:
    assert file_name(DEFAULT_TEMPLATE, naming(), "bvh") == "00007_wave_41.bvh"


def test_no_two_motions_get_one_name_on_any_system() -> None:
    names = FileNames("{name}")
    assert [names.of(1, naming(), kind) for kind in ("npz", "bvh", "npz")] == ["wave.npz", "wave.bvh", "wave.npz"]
    with pytest.raises(InvalidInput, match=r"name_template: two motions would be written to Wave\.npz"):
        names.of(2, naming("Wave"), "npz")


@given(st.text(max_size=200))
def test_any_prompt_makes_a_plain_slug(prompt: str) -> None:
    assert NAME.fullmatch(slug(prompt))
    assert len(slug(prompt)) <= 48


@pytest.mark.parametrize(
    "template", ["../{name}", "/tmp/{name}", "{name}/", "{name}//{seed}", "{name}/../{seed}", "..", "{name}\\{seed}",
                 ".{name}", "{", "{0}", "{name!x}", "{home}", "{name.__class__}", "{tag}", "{tag[a.b]}", "{tag[a].x}",
                 "{tags[0]}", "a:b", "con", "con/{name}", "{index:z}", "{index:99999}", "{index:{seed}}", "C:/{name}",
                 "a/./{name}", "a\n{name}", "\u202e{name}", "{name}/" * 9 + "{seed}", "x" * 300],
)  # fmt: skip
def test_a_template_that_could_leave_the_folder_is_refused(template: str) -> None:
    with pytest.raises(InvalidInput, match="name_template"):
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
    ("name", "why"),
    [
        ("CON", "it is a device name on Windows"),
        ("x" * 300, "has 300 characters"),
        ("_x", "begin with a letter or digit"),
        ("a\u202eb", "U+202E"),
    ],
)
def test_a_name_is_told_why_it_is_refused(name: str, why: str) -> None:
    _, (problem,) = read_item({"prompt": "a person waves", "name": name})
    assert why in problem.message


@pytest.mark.parametrize(
    ("name", "stored", "stem"),
    [
        ("Zoë", "Zoë", "Zoë"),
        ("Zoe\u0308", "Zoë", "Zoë"),
        ("日本 散歩", "日本 散歩", "日本 散歩"),
        ("日本\u3000散歩", "日本 散歩", "日本 散歩"),
        ("Szene 3: auf?", "Szene 3: auf?", "Szene 3_ auf_"),
        ("می\u200cرود", "می\u200cرود", "می\u200cرود"),
        ("1\u200e x", "1\u200e x", "1 x"),
    ],
)
def test_a_name_of_any_script_is_kept_and_its_file_name_derived(name: str, stored: str, stem: str) -> None:
    item, _ = read_item({"prompt": "a person waves", "name": name})
    assert item is not None
    assert item.name == stored
    assert file_name("{name}", naming(stored), "npz") == f"{stem}.npz"


TEXT = st.text(st.characters(), max_size=120)
RESERVED_BY_WINDOWS = ("con", "PRN", "aux.x", "Nul", "com1", "LPT9.tar", "com²", "CONIN$", "nul .x")


@given(
    name=TEXT,
    tag=TEXT,
    template=st.sampled_from([DEFAULT_TEMPLATE, "{name}", "{tag:k}/{name}_{variant}", "{tags}/{index}"]),
)
def test_a_derived_path_stays_in_its_folder_on_every_system(name: str, tag: str, template: str) -> None:
    of = Naming(index=7, name=name, seed=41, variant=12, model="hgm3", job="j", tags=(f"k={tag}",))
    path = file_name(template, of, "npz")
    assert path.count("/") == template.count("/")
    for part in path.split("/"):
        assert len(f"{part}.part".encode()) <= 255
        assert part == unicodedata.normalize("NFC", part)
        assert not set(part) & set('<>:"\\|?*')
        assert find_forbidden(part) is None
        assert part[0] not in ".-~ "
        assert part[-1] not in ". "
        assert not RESERVED.fullmatch(part)
    if template == DEFAULT_TEMPLATE:
        assert path.startswith("00007_")
        assert path.endswith("_41.npz")


@pytest.mark.parametrize("name", [*RESERVED_BY_WINDOWS, "..", ".", "", "-rf", "~root", "a.", " ", "../../etc/passwd"])
def test_names_that_systems_keep_for_themselves_are_made_others(name: str) -> None:
    made = safe_component(name)
    assert made.startswith("_") or made == "a"
    assert not RESERVED.fullmatch(made)
    assert "/" not in made


@given(st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_ .()+=@,-]{0,99}", fullmatch=True))
def test_names_of_the_release_before_keep_their_files(name: str) -> None:
    """Its names were these, without `..`, an ending dot or space, or a device of Windows."""
    if ".." in name or name[-1] in ". " or RESERVED.fullmatch(name):
        return
    item, problems = read_item({"prompt": "a person waves", "name": name})
    assert item is not None, problems
    assert item.name == name
    assert file_name(DEFAULT_TEMPLATE, naming(name), "bvh") == f"00007_{name}_41.bvh"
    assert file_name("{name}", naming(name), "bvh") == f"{name}.bvh"


def test_a_long_name_is_cut_and_what_tells_motions_apart_is_not() -> None:
    of = Naming(index=7, name="日" * 100, seed=41, variant=12, model="hgm3", job="j", tags=("shot=" + "ß" * 59,))
    path = file_name("{tag:shot}_{name}_{variant:03}_{seed}", of, "npz")
    assert len(f"{path}.part".encode()) <= 255
    assert path.endswith("_012_41.npz")
    assert "日" * 20 in path


@pytest.mark.parametrize(
    ("one", "other"), [("Walk", "walk"), ("Straße", "STRASSE"), ("a:b", "a?b"), ("a\u200cb", "ab")]
)
def test_names_that_a_system_takes_for_one_are_refused(one: str, other: str) -> None:
    names = FileNames("{name}")
    names.of(1, naming(one), "npz")
    with pytest.raises(InvalidInput, match="two motions would be written to"):
        names.of(2, naming(other), "npz")


def test_values_of_tags_stand_in_names_and_never_as_paths() -> None:
    of = Naming(7, "wave", 41, 0, "hgm3", "j", ("shot=010", "hero", "take=../x", "Szene Nr=3/4"), "hgm3-x@ab", "a-b")
    assert file_name("{tag[shot]}_{name}", of, "npz") == "010_wave.npz"
    assert file_name("{tag:shot}/{prompt}_{bundle}", of, "npz") == "010/a-b_hgm3-x@ab.npz"
    assert file_name("{tag:Szene Nr}", of, "npz") == "3_4.npz"
    assert check_template("{tag[shot]}_{tags}") == "{tag[shot]}_{tags}"
    with pytest.raises(InvalidInput, match="no tag show="):
        file_name("{tag[show]}", of, "npz")
    assert file_name("{tag[take]}", of, "npz") == "_.._x.npz"
    assert file_name("a/{tag:take}", of, "npz") == "a/_.._x.npz"
