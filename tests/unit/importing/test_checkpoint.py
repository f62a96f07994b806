"""Checkpoints of other projects: read without code, with an account of every tensor, and refused with reasons."""

from __future__ import annotations

import gzip
import io
import pickle
import tarfile
import zipfile
from collections import Counter, OrderedDict
from pathlib import Path

import pytest
import torch
from torch import nn

from marey.core.errors import InvalidFile, NotFound
from marey.importing import Checkpoint
from marey.importing.torch_files import load_torch
from tests.unit.importing.conftest import save


def published(name: str) -> str:
    return f"net.{name}"


def fresh() -> nn.Module:
    return nn.Sequential(nn.Linear(3, 4), nn.Linear(4, 2))


def test_every_tensor_is_read_and_accounted_for(saved: Path, network: nn.Module) -> None:
    checkpoint = Checkpoint.open(saved, shown="model/net_best.tar")
    found = fresh()
    checkpoint.section("vq_model", "model").fill(found, published)
    account = checkpoint.finish()
    assert all(torch.equal(a, b) for a, b in zip(found.parameters(), network.parameters(), strict=True))
    assert not found.training
    assert account.file == "model/net_best.tar"
    assert account.bytes == saved.stat().st_size
    assert sorted(account.used) == sorted(f"model.net.{name}" for name in network.state_dict())
    assert account.ignored == {"opt_net": "state of an optimizer"}


def test_the_first_key_that_the_file_has_is_taken(tmp_path: Path) -> None:
    file = save(tmp_path / "a.tar", {"vq_model": {"x": torch.ones(2)}, "model": {"y": torch.ones(2)}})
    checkpoint = Checkpoint.open(file)
    assert checkpoint.section("vq_model", "model").names == ("x",)
    with pytest.raises(InvalidFile, match=r"has no 'net' or 'trans'"):
        checkpoint.section("net", "trans")


def test_a_tensor_that_is_neither_read_nor_ignored_is_refused(tmp_path: Path) -> None:
    file = save(tmp_path / "a.tar", {"model": {"a": torch.ones(2), "extra.b": torch.ones(1)}, "other": torch.ones(1)})
    checkpoint = Checkpoint.open(file)
    section = checkpoint.section("model")
    section.take("a")
    with pytest.raises(
        InvalidFile, match=r"holds tensors that this import does not know: model\.extra\.b, other"
    ) as caught:
        checkpoint.finish()
    assert caught.value.where == str(file)
    section.ignore(r"extra\..*", "computed anew")
    checkpoint.ignore("other", "not needed")
    assert checkpoint.finish().ignored == {"model.extra.b": "computed anew", "other": "not needed"}


def test_missing_tensors_and_other_shapes_are_listed_together(saved: Path) -> None:
    section = Checkpoint.open(saved).section("model")
    wide = nn.Sequential(nn.Linear(5, 4), nn.Linear(4, 2), nn.Linear(2, 2))
    with pytest.raises(InvalidFile) as caught:
        section.fill(wide, published)
    assert "net.0.weight has shape (4, 3), not (4, 5)" in caught.value.message
    assert "lacks the tensor net.2.weight" in caught.value.message
    assert caught.value.where == f"{saved}: model"


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_numbers_that_are_not_finite_are_refused(tmp_path: Path, value: float) -> None:
    file = save(tmp_path / "a.tar", {"model": {"a": torch.tensor([1.0, value])}})
    with pytest.raises(InvalidFile, match="a holds NaN or infinite numbers"):
        Checkpoint.open(file).section("model").take("a")


def test_whole_numbers_are_no_weights(tmp_path: Path) -> None:
    file = save(tmp_path / "a.tar", {"model": {"a": torch.arange(3)}})
    with pytest.raises(InvalidFile, match=r"a holds torch\.int64"):
        Checkpoint.open(file).section("model").take("a")


def test_weights_in_half_precision_are_read_in_single_precision(tmp_path: Path) -> None:
    file = save(tmp_path / "a.tar", {"model": {"a": torch.ones(2, dtype=torch.float16)}})
    assert Checkpoint.open(file).section("model").take("a", (None,)).dtype == torch.float32


def test_both_formats_of_torch_are_read(tmp_path: Path) -> None:
    state = OrderedDict(a=torch.arange(4.0))
    for zipped in (True, False):
        file = save(tmp_path / f"{zipped}.pth", state, _use_new_zipfile_serialization=zipped)
        assert torch.equal(Checkpoint.open(file).whole().take("a", (4,)), torch.arange(4.0))


def test_counters_of_a_schedule_are_plain_values(tmp_path: Path) -> None:
    file = save(tmp_path / "a.tar", {"trans": {"a": torch.ones(1)}, "scheduler": {"milestones": Counter({3: 1})}})
    checkpoint = Checkpoint.open(file)
    checkpoint.section("trans").take("a")
    assert checkpoint.finish().ignored == {}


@pytest.mark.parametrize("zipped", [True, False])
def test_truncated_files_are_refused(saved: Path, tmp_path: Path, zipped: bool) -> None:
    whole = save(tmp_path / "whole.tar", {"model": {"a": torch.ones(5000)}}, _use_new_zipfile_serialization=zipped)
    broken = tmp_path / "broken.tar"
    for size in (len(whole.read_bytes()) // 2, 700, 60):
        broken.write_bytes(whole.read_bytes()[:size])
        with pytest.raises(InvalidFile, match=r"truncated|cannot be read") as caught:
            Checkpoint.open(broken)
        assert caught.value.where == str(broken)


class Attack:
    def __reduce__(self) -> tuple[object, ...]:
        return (open, ("/nonexistent/written", "w"))


@pytest.mark.parametrize("zipped", [True, False])
@pytest.mark.parametrize("value", [Attack(), {"model": nn.Linear(2, 2)}])
def test_code_and_objects_are_never_loaded(tmp_path: Path, value: object, zipped: bool) -> None:
    file = save(tmp_path / "a.tar", value, _use_new_zipfile_serialization=zipped)
    with pytest.raises(InvalidFile, match=r"holds code or objects of Python \(.*(open|Linear)\)") as caught:
        Checkpoint.open(file)
    assert "state dicts" in str(caught.value.hint)


def archive_of(name: str) -> bytes:
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w") as tar:
        tar.addfile(tarfile.TarInfo(name))
    return packed.getvalue()


def zip_of(name: str, compression: int = zipfile.ZIP_STORED) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", compression) as archive:
        archive.writestr(name, b"\x80\x02}q\x00.")
    return packed.getvalue()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b"<!DOCTYPE html><html>", "is a web page"),
        (b"version https://git-lfs.github.com/spec/v1\n", "Git LFS"),
        (gzip.compress(b"x" * 100), "gzip"),
        (archive_of("model"), "is a tar archive"),
        (b"no checkpoint at all", "is no file of torch.save"),
        (zip_of("readme.txt"), "without a checkpoint"),
        (zip_of("archive/data.pkl", zipfile.ZIP_DEFLATED), "is packed"),
        (pickle.dumps([1, 2]), "cannot be read|holds list"),
    ],
    ids=["empty", "page", "pointer", "gzip", "tar", "text", "zip", "packed zip", "pickle"],
)
def test_other_formats_are_named(tmp_path: Path, content: bytes, said: str) -> None:
    file = tmp_path / "net.tar"
    file.write_bytes(content)
    with pytest.raises(InvalidFile, match=said):
        Checkpoint.open(file)


def test_a_file_that_is_missing_or_no_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="no such file"):
        Checkpoint.open(tmp_path / "net.tar")
    with pytest.raises(InvalidFile, match="not a regular file"):
        Checkpoint.open(tmp_path)


def test_files_and_tensors_over_the_limit_are_refused(tmp_path: Path) -> None:
    file = save(tmp_path / "a.tar", {"model": {"a": torch.ones(5000)}})
    with pytest.raises(InvalidFile, match="is over 1,000 bytes"):
        load_torch(file, limit=1000)
    repeated = save(tmp_path / "b.tar", {"model": {"a": torch.ones(1).expand(10**9)}})
    with pytest.raises(InvalidFile, match="its tensors have over"):
        load_torch(repeated, limit=10**6)


def test_what_stands_under_a_key_must_be_tensors(tmp_path: Path) -> None:
    file = save(tmp_path / "a.tar", {"model": {"a": 1}, "other": [torch.ones(1)], "none": {}})
    checkpoint = Checkpoint.open(file)
    with pytest.raises(InvalidFile, match="holds int as 'a'"):
        checkpoint.section("model")
    for key in ("other", "none"):
        with pytest.raises(InvalidFile, match="does not hold tensors by name"):
            checkpoint.section(key)


def test_tensors_that_the_caller_made_are_loaded_beside_the_others(tmp_path: Path) -> None:
    file = save(tmp_path / "a.tar", {"model": {"w": torch.ones(2, 3), "b": torch.ones(2), "c": torch.zeros(1, 2)}})
    section = Checkpoint.open(file).section("model")
    made = {"bias": section.take("c", (1, 2))[0]}
    network = nn.Linear(3, 2)
    section.fill(network, lambda name: "w", made=made)
    assert torch.equal(network.bias, torch.zeros(2))
    with pytest.raises(InvalidFile, match=r"bias would have shape \(1,\), not \(2,\)"):
        section.fill(nn.Linear(3, 2), lambda name: "w", made={"bias": torch.ones(1)})
