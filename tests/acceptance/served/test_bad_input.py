"""Bad input: one clear message that says what to do, the right exit code, nothing half done."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from marey.core import defaults
from marey.registry import get_model
from tests.support.marey import TINY, Marey, tiny
from tests.support.models import another_model


def nothing_new(marey: Marey, before: list[dict[str, object]]) -> None:
    assert marey.jobs() == before


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("", "the prompt is empty"),
        (" \t ", "the prompt is empty"),
        ("walk " * 10_000, "at most 200 words"),
        ("👋🏽🎉", "no English words"),
        ("一个人向前走", "no English words"),
        ("человек идёт вперёд", "no English words"),
        ("x" * 150, "150 characters"),
        ("a person\x07waves", "control character U+0007"),
    ],
)
def test_a_prompt_that_cannot_be_used(marey: Marey, prompt: str, said: str) -> None:
    before = marey.jobs()
    marey("submit", "a person walks", prompt).refused(2, "PROMPT: 1 problem", "argument 2: prompt", said)
    nothing_new(marey, before)


def test_a_prompt_with_a_nul_byte(marey: Marey) -> None:
    marey("submit", "-f", "-", stdin=b'{"prompt": "a person\\u0000waves"}\n').refused(2, "line 1: prompt", "NUL byte")


def test_a_csv_with_bad_lines_among_a_thousand_lists_them_all_and_enqueues_nothing(
    marey: Marey, tmp_path: Path
) -> None:
    rows = [["a person waves", "2"] for _ in range(1000)]
    rows[5] = ["", "2"]
    rows[6] = ["a person waves", "long"]
    rows[998] = ["a person waves", "1000"]
    file = tmp_path / "prompts.csv"
    file.write_text("\n".join(["prompt,seconds", *(",".join(row) for row in rows)]))
    before = marey.jobs()
    ran = marey("submit", "-f", file).refused(
        2,
        "3 problems",
        "line 7: prompt: the prompt is empty",
        "line 8: seconds: is 'long', not a number",
        "line 1000: seconds: 1000 is outside",
    )
    assert ran.out == ""
    nothing_new(marey, before)


def test_an_unknown_column_lists_the_known_ones(marey: Marey) -> None:
    ran = marey("submit", "-f", "-", "--input-format", "csv", stdin="prompt,length\na person waves,3\n")
    ran.refused(2, "stdin", "line 1: 'length' is not a known column", "prompt, name, seconds, seed")


@pytest.mark.parametrize("seconds", ["0.1", "1000", "-3", "nan"])
def test_a_length_no_model_can_make(marey: Marey, offline: Marey, tmp_path: Path, seconds: str) -> None:
    before = marey.jobs()
    marey("submit", "a person waves", f"--seconds={seconds}").refused(2, "seconds")
    nothing_new(marey, before)
    offline("generate", "a person waves", f"--seconds={seconds}", "-o", tmp_path / "out").refused(2, "seconds")
    assert not (tmp_path / "out").exists()


def test_a_length_this_model_cannot_make_names_its_range(marey: Marey, offline: Marey, tmp_path: Path) -> None:
    marey("submit", "a person waves", "--seconds", 12).refused(2, "12 is outside 0.8 to 9.8 seconds", TINY)
    ran = offline("generate", "a person waves", "--seconds", 12, "-o", tmp_path / "out")
    ran.refused(2, "12 is outside 0.8 to 9.8 seconds", TINY)
    assert not (tmp_path / "out").exists()


def test_a_setting_that_only_another_model_has_is_refused_by_name(marey: Marey, offline: Marey, tmp_path: Path) -> None:
    model = another_model()
    own = [setting.name for setting in get_model(model).settings]
    foreign = next(each.name for each in get_model(defaults.MODEL).settings if each.name not in own)
    line = json.dumps({"prompt": "a person waves", "model": model, "settings": {foreign: 12}})
    said = (2, "line 1: settings", f"{foreign!r}", tiny(model))
    marey("submit", "-f", "-", stdin=line).refused(*said, *own)
    offline("generate", "-f", "-", "-o", tmp_path / "out", stdin=line).refused(*said)
    assert not (tmp_path / "out").exists()


def test_an_unknown_model_names_the_known_ones(marey: Marey, offline: Marey) -> None:
    marey("submit", "a person waves", "--model", "nomo").refused(2, "argument 1: model", "'nomo'", TINY)
    offline("generate", "a person waves", "--model", "nomo").refused(3, "'nomo'", TINY)
    marey("models", "show", "nomo").refused(3, "'nomo'", TINY)


@pytest.mark.parametrize("name", ["../../etc/x", "/etc/x", "a/b", "..\\x", ".ssh", "con"])
def test_a_name_with_path_tricks(marey: Marey, name: str) -> None:
    marey("submit", "-f", "-", stdin=json.dumps({"prompt": "a person waves", "name": name})).refused(
        2, "line 1: name", "cannot be a file name"
    )


@pytest.mark.parametrize(
    "template", ["../{name}", "/tmp/{name}", "{job}/../{name}", "{job}//{name}", "{nonsense}", "{", "{name.__class__}"]
)
def test_a_name_template_with_path_tricks(offline: Marey, tmp_path: Path, template: str) -> None:
    ran = offline("generate", "a person waves", "-o", tmp_path / "out", "--name-template", template)
    ran.refused(2, "--name-template", "{index}")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("more", [(), ("--overwrite",)])
def test_a_name_that_two_motions_would_share_is_refused_before_one_is_made(
    offline: Marey, tmp_path: Path, more: tuple[str, ...]
) -> None:
    share = ("generate", "a person walks", "-o", tmp_path / "out", *more)
    ran = offline(*share, "--variants", 3, "--name-template", "y_{index}")
    ran.refused(2, "--name-template: two motions would be written to y_0.bvh", "{index} and {seed}")
    ran = offline("generate", "a person walks", "A person walks!", "-o", tmp_path / "out", "--seed", 1,
                  "--name-template", "{name}", *more)  # fmt: skip
    ran.refused(2, "two motions would be written to a-person-walks.bvh")
    lines = [{"prompt": "a person bows", "tags": [tag] if tag else []} for tag in ("shot=1", "shot=2", "", "shot=4")]
    ran = offline("generate", "-f", "-", "-o", tmp_path / "out", "--name-template", "{tag[shot]}", *more,
                  stdin="\n".join(map(json.dumps, lines)))  # fmt: skip
    ran.refused(2, "has no tag shot=…")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("variants", [0, -1, 101])
def test_a_number_of_variants_that_no_row_could_have_is_refused(offline: Marey, tmp_path: Path, variants: int) -> None:
    for command in ("generate", "submit"):
        where = ("-o", tmp_path / "out") if command == "generate" else ()
        ran = offline(command, "a person walks", f"--variants={variants}", *where)
        ran.refused(2, f"--variants: {variants} is outside 1 to 100")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_enqueued(marey: Marey, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    before = marey.jobs()
    ran = marey("submit", "a person waves", "--fetch", tmp_path / "file" / "sub")
    ran.refused(2, str(tmp_path / "file"), "cannot write here", "-o")
    nothing_new(marey, before)


def test_a_home_that_cannot_be_written(offline: Marey, tmp_path: Path) -> None:
    (tmp_path / "home").write_text("a file, not a folder")
    offline("serve", "--port", "0").refused(2, str(tmp_path / "home"), "cannot be written", "MAREY_HOME")


def test_no_prompt_both_kinds_of_prompt_and_a_missing_file(marey: Marey, tmp_path: Path) -> None:
    marey("submit").refused(2, "no prompt is given", "-f")
    marey("submit", "a person waves", "-f", "p.csv").refused(2, "both PROMPT and -f")
    marey("submit", "-f", tmp_path / "none.csv").refused(3, "none.csv", "no such file")
    marey("submit", "-f", "-", stdin="").refused(2, "no prompt")
    marey("submit", "a person waves", "--priority", 5000).refused(2, "priority")
    marey("submit", "a person waves", "--seed", 2**31).refused(2, "seed")


# --- bundles ---


def damaged(models: Path, folder: Path) -> Path:
    shutil.copytree(models / TINY, folder / "damaged")
    return folder / "damaged"


def test_truncated_weights(offline: Marey, models: Path, tmp_path: Path) -> None:
    bundle = damaged(models, tmp_path)
    weights = bundle / "masked.safetensors"
    weights.write_bytes(weights.read_bytes()[:-100])
    ran = offline("generate", "a person waves", "--bundle", bundle, "-o", tmp_path / "out")
    ran.refused(2, "masked.safetensors", "truncated", "Fetch or import the bundle again")
    assert not (tmp_path / "out").exists()


def test_damaged_weights(offline: Marey, models: Path, tmp_path: Path) -> None:
    bundle = damaged(models, tmp_path)
    weights = bundle / "masked.safetensors"
    content = bytearray(weights.read_bytes())
    content[-1] ^= 1
    weights.write_bytes(content)
    offline("generate", "a person waves", "--bundle", bundle).refused(2, "masked.safetensors", "sha256")


def test_a_foreign_bundle_and_no_bundle_at_all(offline: Marey, models: Path, tmp_path: Path) -> None:
    bundle = damaged(models, tmp_path)
    manifest = json.loads((bundle / "manifest.json").read_text())
    (bundle / "manifest.json").write_text(json.dumps({**manifest, "model": "nomo"}))
    offline("generate", "a person waves", "--bundle", bundle).refused(2, "nomo")
    (bundle / "manifest.json").write_text("{}")
    offline("generate", "a person waves", "--bundle", bundle).refused(2, "not a manifest this version reads")
    offline("generate", "a person waves", "--bundle", tmp_path).refused(2, "not a model bundle")
    offline("generate", "a person waves", "--bundle", tmp_path / "none").refused(3, "no bundle")


def test_serving_without_a_model_says_so(offline: Marey, tmp_path: Path) -> None:
    (tmp_path / "no-models").mkdir()
    replace(offline, models=tmp_path / "no-models")("serve", "--port", 0).refused(3, "'hgm3'", "MAREY_MODELS")


# --- motion files ---


def test_a_pickle_in_an_npz_is_never_loaded(offline: Marey, tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[object, ...]:
            return (Path.touch, (tmp_path / "sprung",))

    np.savez(tmp_path / "trap.npz", joints=np.array([Trap()], dtype=object))
    for command in (
        ("convert", tmp_path / "trap.npz", tmp_path / "o.bvh"),
        ("render", tmp_path / "trap.npz", "-o", "o.png"),
    ):
        offline(*command).refused(2, "trap.npz")
    assert not (tmp_path / "sprung").exists()
    assert not (tmp_path / "o.bvh").exists()


def test_broken_motion_files(offline: Marey, tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_text("HIERARCHY\nROOT Hips\n{\n  OFFSET 0 0\n")
    offline("convert", tmp_path / "a.bvh", tmp_path / "a.npz").refused(2, "a.bvh", "line 4")
    (tmp_path / "b.npz").write_bytes(b"PK\x03\x04 cut off")
    offline("convert", tmp_path / "b.npz", tmp_path / "b.bvh").refused(2, "b.npz")
    offline("convert", tmp_path / "c.npz", tmp_path / "c.bvh").refused(3, "no such file")
    offline("convert", tmp_path / "a.c3d", tmp_path / "c.bvh").refused(2, ".c3d", ".bvh, .fbx, .gif, .glb, .mp4, .npz")
    offline("render", tmp_path / "a.bvh", "-o", tmp_path / "a.gif").refused(2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bvh", "b.npz"]
