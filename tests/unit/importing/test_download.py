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


def test_statistics_are_read_from_files_of_torch_as_well(tmp_path: Path) -> None:
    values = {"mean": torch.tensor([-1.0, 0.25]), "std": torch.tensor([0.1, 2.0]).double()}
    for name, value in values.items():
        torch.save(value, tmp_path / f"{name}.pt")
    download = Download(tmp_path)
    mean, std = download.statistics(tmp_path, 2, ending="pt")
    assert mean.dtype == std.dtype == np.float32
    assert (mean.tolist(), std.tolist()) == ([-1, 0.25], [np.float32(0.1), 2])
    assert [each.file for each in download.finish()] == ["mean.pt", "std.pt"]


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (torch.tensor([1.0, 0.0]), r"std\.pt: holds deviations that are not above 0"),
        (torch.tensor([1.0, torch.nan]).bfloat16(), "NaN"),
        (torch.ones(3), r"has shape \(3,\), not \(2\)"),
        (torch.ones(2, dtype=torch.int64), "holds int64"),
        (torch.ones(2).to_sparse(), "not one array of numbers"),
        (torch.ones(2, device="meta"), "not one array of numbers"),
        ({"std": torch.ones(2)}, "holds dict, not one array of numbers"),
        (torch.nn.Linear(1, 1), "holds code or objects of Python"),
    ],
)
def test_files_of_torch_with_anything_else_are_refused(tmp_path: Path, value: object, said: str) -> None:
    torch.save(torch.ones(2), tmp_path / "mean.pt")
    torch.save(value, tmp_path / "std.pt")
    with pytest.raises(InvalidFile, match=said):
        Download(tmp_path).statistics(tmp_path, 2, ending="pt")


def test_a_configuration_in_json_is_read_and_in_the_account(tmp_path: Path) -> None:
    (tmp_path / "config.json").write_text('{"model": {"layers": 6}}', encoding="utf-8")
    download = Download(tmp_path)
    assert download.json(tmp_path / "config.json").section("model").integer("layers") == 6
    assert [each.file for each in download.finish()] == ["config.json"]
    (tmp_path / "config.json").write_text("[1]", encoding="utf-8")
    with pytest.raises(InvalidFile, match="no table of fields"):
        download.json(tmp_path / "config.json")
