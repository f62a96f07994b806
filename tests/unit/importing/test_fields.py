"""Configurations of other projects: `opt.txt` and YAML, and errors that name file and field."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from marey.core.errors import InvalidFile, NotFound
from marey.importing import Fields, read_options, read_yaml

OPTIONS = """------------ Options -------------
batch_size: 256
code_dim: 512
dropout_rate: +0.2
gamma: -0.05
lr: 1e-05
name: rvq_nq6: test
seed: -1
shared_codebook: False
vq_act: relu
vq_norm: None
window_size = 64
-------------- End ----------------
"""
YAML = """
exp:
  name: hrvq
model:
  n_heads: 8
  width: 512.0
  lr: 1e-4
  milestones: 30_500
  scales: [8, 4, 2, 1]
  attention: true
  norm: null
"""


@pytest.fixture
def options(tmp_path: Path) -> Fields:
    (tmp_path / "opt.txt").write_text(OPTIONS, encoding="utf-8")
    return read_options(tmp_path / "opt.txt")


@pytest.fixture
def yaml(tmp_path: Path) -> Fields:
    (tmp_path / "vq.yaml").write_text(YAML, encoding="utf-8")
    return read_yaml(tmp_path / "vq.yaml")


def test_options_are_flags_numbers_or_text_and_foreign_lines_are_skipped(options: Fields) -> None:
    assert options.integer("code_dim") == 512
    assert options.integer("seed") == -1
    assert options.number("dropout_rate") == 0.2
    assert options.number("gamma") == -0.05
    assert options.number("lr") == 1e-5
    assert options.flag("shared_codebook") is False
    assert options.text("vq_act") == "relu"
    assert options.text("vq_norm") == "None"
    assert options.text("name") == "rvq_nq6: test"
    assert "window_size = 64" not in options
    assert not any("-" in name for name in options.values)


def test_yaml_has_sections_and_plain_values(yaml: Fields) -> None:
    model = yaml.section("model")
    assert model.integer("n_heads") == 8
    assert model.integer("width") == 512
    assert model.number("lr") == 1e-4
    assert model.integer("milestones") == 30500
    assert model.integers("scales") == (8, 4, 2, 1)
    assert model.flag("attention") is True
    assert model.text("norm") == "None"
    assert yaml.search("n_heads") == {"model.n_heads": 8}


def test_a_default_stands_for_a_missing_field_alone(options: Fields) -> None:
    assert options.integer("depth", 3) == 3
    assert options.flag("ema", False) is False
    with pytest.raises(InvalidFile):
        options.integer("vq_act", 3)


@pytest.mark.parametrize(
    ("read", "said"),
    [
        (lambda f: f.integer("depth"), "has no 'depth'"),
        (lambda f: f.integer("vq_act"), "vq_act: is 'relu', not a whole number"),
        (lambda f: f.integer("shared_codebook"), "shared_codebook: is 'False', not a whole number"),
        (lambda f: f.number("vq_norm"), "vq_norm: is 'None', not a number"),
        (lambda f: f.flag("code_dim"), "code_dim: is '512', not True or False"),
        (lambda f: f.text("code_dim"), "code_dim: is '512', not text"),
        (lambda f: f.integers("code_dim"), "code_dim: is '512', not a list of whole numbers"),
        (lambda f: f.section("code_dim"), "code_dim: is '512', not a section"),
        (lambda f: f.expect("vq_act", "gelu", "silu"), "vq_act: is 'relu', not 'gelu' or 'silu'"),
    ],
)
def test_a_wrong_field_is_named_with_its_file(options: Fields, read: Callable[[Fields], object], said: str) -> None:
    with pytest.raises(InvalidFile, match=said) as caught:
        read(options)
    assert str(caught.value.where).endswith("opt.txt")


def test_a_field_that_is_as_expected_or_not_there_passes(options: Fields) -> None:
    options.expect("vq_act", "relu")
    options.expect("no_such_field", "relu")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"a: [1, 2", "is not YAML"),
        (b"a: !!python/object/apply:os.system ['true']", "is not YAML of plain values"),
        (b"- 1\n- 2\n", "holds no table"),
        (b"\xff\xfe\x00", "is not text"),
        (b"[" * 1200, "is not YAML"),
    ],
)
def test_a_broken_yaml_is_refused(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "a.yaml").write_bytes(content)
    with pytest.raises(InvalidFile, match=said):
        read_yaml(tmp_path / "a.yaml")


def test_sections_that_repeat_without_end_are_searched_up_to_a_limit(tmp_path: Path) -> None:
    lines = ["a0: &a0 {n_heads: 4}"] + [
        f"a{n}: &a{n} {{x: *a{n - 1}, y: *a{n - 1}, z: *a{n - 1}}}" for n in range(1, 20)
    ]
    (tmp_path / "a.yaml").write_text("\n".join(lines), encoding="utf-8")
    assert 4 in read_yaml(tmp_path / "a.yaml").search("n_heads").values()


def test_a_missing_or_empty_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="no such file"):
        read_options(tmp_path / "opt.txt")
    (tmp_path / "opt.txt").write_text("nothing here\n", encoding="utf-8")
    with pytest.raises(InvalidFile, match="holds no lines"):
        read_options(tmp_path / "opt.txt")


def test_sizes_have_limits() -> None:
    fields = Fields("opt.txt", {"heads": 6, "width": 0})
    assert fields.size("heads", 6) == 6
    assert fields.size("layers", 9, default=2) == 2
    for name, high, low, said in (("heads", 5, 1, "heads: 6 is outside 1 to 5"), ("width", 9, 1, "width: 0 is outside"),
                                  ("heads", 9, 7, "6 is outside 7 to 9")):  # fmt: skip
        with pytest.raises(InvalidFile, match=said):
            fields.size(name, high, low=low)
    with pytest.raises(InvalidFile, match="has no 'layers'"):
        fields.size("layers", 9)
