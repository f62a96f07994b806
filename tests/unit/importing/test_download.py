"""The folder of a download: parts by their published names, statistics, and the account of what was read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.importing import Download
from tests.unit.importing.conftest import save


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    root = tmp_path / "checkpoints" / "t2m"
    save(root / "rvq_nq6" / "model" / "net.tar", {"model": {"a": torch.ones(2)}, "ep": 1})
    (root / "rvq_nq6" / "opt.txt").write_text("depth: 3\n", encoding="utf-8")
    (root / "rvq_nq6" / "meta").mkdir()
    for name in ("mean", "std"):
        np.save(root / "rvq_nq6" / "meta" / f"{name}.npy", np.full(4, 2.0))
    return tmp_path


@pytest.mark.parametrize("named", ["", "checkpoints", "checkpoints/t2m"])
def test_parts_are_found_from_every_level_of_the_published_folder(folder: Path, named: str) -> None:
    download = Download(folder / named, inside=("checkpoints/t2m",))
    found = download.find("rvq_nq6*/model/net.tar", what="the tokenizer")
    assert found.read_bytes() == (folder / "checkpoints/t2m/rvq_nq6/model/net.tar").read_bytes()
    assert download.has("rvq_*")
    assert not download.has("tres_*")


def test_the_first_pattern_that_has_a_file_is_taken(folder: Path) -> None:
    download = Download(folder, inside=("checkpoints/t2m",))
    tokenizer = download.find("rvq_*", what="the folder of the tokenizer")
    assert download.find("opt.yaml", "opt.txt", what="options", within=tokenizer).name == "opt.txt"


def test_a_missing_part_is_named_with_the_places_it_was_looked_for(folder: Path) -> None:
    download = Download(folder, inside=("checkpoints/t2m",))
    with pytest.raises(NotFound) as caught:
        download.find("tres_*/model/net.tar", "res_*/model/net.tar", what="the residual transformer")
    assert caught.value.message == (
        "the residual transformer is missing: there is no tres_*/model/net.tar or res_*/model/net.tar"
    )
    assert caught.value.where == str(folder / "checkpoints" / "t2m")
    assert caught.value.hint


def test_of_several_parts_none_is_guessed(folder: Path) -> None:
    save(folder / "checkpoints/t2m/rvq_nq7/model/net.tar", {"model": {"a": torch.ones(2)}})
    with pytest.raises(InvalidInput, match="has several of the tokenizer"):
        Download(folder, inside=("checkpoints/t2m",)).find("rvq_*/model/net.tar", what="the tokenizer")


def test_a_folder_that_is_none_is_refused(folder: Path) -> None:
    with pytest.raises(NotFound, match="no such folder"):
        Download(folder / "nowhere")
    with pytest.raises(InvalidInput, match="is a file"):
        Download(folder / "checkpoints/t2m/rvq_nq6/opt.txt")


def test_every_file_that_was_read_is_in_the_account(folder: Path) -> None:
    download = Download(folder, inside=("checkpoints/t2m",))
    root = download.root / "rvq_nq6"
    assert download.options(root / "opt.txt").integer("depth") == 3
    mean, std = download.statistics(root / "meta", 4)
    assert mean.dtype == std.dtype == np.float32
    section = download.checkpoint(root / "model" / "net.tar").section("model")
    with pytest.raises(InvalidFile, match=r"does not know: model\.a"):
        download.finish()
    section.take("a")
    accounts = {each.file: each for each in download.finish()}
    assert sorted(accounts) == [
        f"checkpoints/t2m/rvq_nq6/{name}" for name in ("meta/mean.npy", "meta/std.npy", "model/net.tar", "opt.txt")
    ]
    assert accounts["checkpoints/t2m/rvq_nq6/model/net.tar"].used == ("model.a",)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.ones(5), r"has shape \(5,\), not \(4\)"),
        (np.array([1, 1, np.nan, 1]), "NaN"),
        (np.array([1.0, 0, 1, 1]), "not above 0"),
        (np.array([1, 1, 1, 1]), "holds int64"),
        (np.array([object()] * 4), "pickled objects"),
    ],
)
def test_statistics_of_another_shape_or_kind_are_refused(folder: Path, values: np.ndarray, said: str) -> None:
    download = Download(folder, inside=("checkpoints/t2m",))
    np.save(download.root / "rvq_nq6" / "meta" / "std.npy", values)
    with pytest.raises(InvalidFile, match=said):
        download.statistics(download.root / "rvq_nq6" / "meta", 4)
