"""Vectors of fixed texts are made once and kept in the home."""

import fcntl
import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from numpy.typing import NDArray

from marey.text.kept_vectors import KeptVectors
from marey.text.meaning import MeaningJudge

TEXTS = ["a person waves", "a person bows"]


class Maker:
    """Makes vectors, and counts the texts that it was asked for."""

    def __init__(self) -> None:
        self.asked = 0

    def __call__(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Return a vector (2,) a text."""
        self.asked += len(texts)
        return np.array([[len(text), self.asked] for text in texts], np.float32)


def test_vectors_are_made_once(tmp_path: Path) -> None:
    make = Maker()
    first = KeptVectors(tmp_path, "encoder").get(TEXTS, make)
    second = KeptVectors(tmp_path, "encoder").get(TEXTS, make)
    assert make.asked == 2
    assert first.tobytes() == second.tobytes()
    assert not any(path.stat().st_mode & 0o077 for path in tmp_path.rglob("*"))


@pytest.mark.parametrize(("encoder", "texts"), [("another", TEXTS), ("encoder", TEXTS[::-1])])
def test_other_texts_and_encoders_have_vectors_of_their_own(tmp_path: Path, encoder: str, texts: list[str]) -> None:
    make = Maker()
    KeptVectors(tmp_path, "encoder").get(TEXTS, make)
    KeptVectors(tmp_path, encoder).get(texts, make)
    assert make.asked == 4


@pytest.mark.parametrize("content", ["cut", "empty", "text", "objects", "numbers", "fewer", "endless"])
def test_a_damaged_file_is_made_anew(tmp_path: Path, content: str) -> None:
    make = Maker()
    KeptVectors(tmp_path, "encoder").get(TEXTS, make)
    (path,) = (tmp_path / "vectors").glob("*.npy")
    _damage(path, content)
    assert KeptVectors(tmp_path, "encoder").get(TEXTS, make)[0, 1] == 4
    assert KeptVectors(tmp_path, "encoder").get(TEXTS, make)[0, 1] == 4
    assert {path, path.with_suffix(".lock")} == set((tmp_path / "vectors").iterdir())


def _damage(path: Path, how: str) -> None:
    whole = path.read_bytes()
    arrays = {
        "objects": np.array([[{}, {}], [{}, {}]], object),
        "numbers": np.full((2, 2), np.nan, np.float32),
        "fewer": np.ones((1, 2), np.float32),
    }
    if how in arrays:
        with path.open("wb") as file:
            np.save(file, arrays[how])
    else:
        endless = whole.replace(b"(2, 2)", b"(2, 2000000000)")
        path.write_bytes({"cut": whole[:-3], "empty": b"", "text": b"not numbers", "endless": endless}[how])


def test_a_home_that_cannot_be_written_keeps_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "vectors").write_text("a file where the folder would be")
    make = Maker()
    with caplog.at_level(logging.INFO):
        assert len(KeptVectors(tmp_path, "encoder").get(TEXTS, make)) == 2
    assert "are not kept" in caplog.text
    assert make.asked == 2


def test_one_makes_the_vectors_and_the_others_wait_for_them(tmp_path: Path) -> None:
    make, begun, go_on = Maker(), Event(), Event()

    def slowly(texts: Sequence[str]) -> NDArray[np.float32]:
        begun.set()
        assert go_on.wait(60)
        return make(texts)

    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(KeptVectors(tmp_path, "encoder").get, TEXTS, slowly)
        assert begun.wait(60)
        second = pool.submit(KeptVectors(tmp_path, "encoder").get, TEXTS, make)
        assert not wait([second], 0.3).done
        go_on.set()
        assert first.result(60).tobytes() == second.result(60).tobytes()
    assert make.asked == 2


def test_none_waits_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    KeptVectors(tmp_path, "encoder").get(TEXTS, Maker())
    (path,) = (tmp_path / "vectors").glob("*.npy")
    path.unlink()
    monkeypatch.setattr("marey.text.kept_vectors.WAIT_S", 0.2)
    with path.with_suffix(".lock").open("a") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert len(KeptVectors(tmp_path, "encoder").get(TEXTS, Maker())) == 2


def test_a_judge_encodes_the_phrases_of_the_vocabulary_once(tmp_path: Path) -> None:
    asked: list[str] = []

    def pooled(texts: Sequence[str]) -> list[NDArray[np.float32]]:
        asked.extend(texts)
        return [np.full(2, len(text), np.float32) for text in texts]

    prompt = np.ones(2, np.float32)
    first = MeaningJudge(pooled, KeptVectors(tmp_path, "encoder")).nearest_verb(prompt)
    asked.clear()
    assert MeaningJudge(pooled, KeptVectors(tmp_path, "encoder")).nearest_verb(prompt) == first
    assert len(asked) == 2, "the neutral phrases alone"
