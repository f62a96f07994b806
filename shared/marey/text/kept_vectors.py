"""Vectors of texts that never change, kept in files, so that only the first process of a machine waits for them."""

from __future__ import annotations

import fcntl
import hashlib
import io
import json
import logging
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import MareyError
from marey.core.private_home import FOLDER_MODE, open_private
from marey.core.whole_files import whole_file
from marey.motion.files import read_limited

log = logging.getLogger(__name__)

FOLDER = "vectors"
"""Of the home. Its files can be removed at any time."""
LARGEST = 64 * 2**20
"""Bytes of a file that is read."""
WAIT_S, TICK = 30.0, 0.05
"""Seconds for which a process waits for another one that makes the same vectors, and between two looks."""


class KeptVectors:
    """Files of vectors in a folder of the home, named after the encoder and the texts that they are of."""

    def __init__(self, home: Path, encoder_sha256: str) -> None:
        self._home = home.expanduser()
        self._encoder = encoder_sha256

    def get(self, texts: Sequence[str], make: Callable[[Sequence[str]], NDArray[np.float32]]) -> NDArray[np.float32]:
        """Return the vectors (N, W) of N texts from their file, or make and keep them.

        A damaged file is made anew, by one process while the others wait. A home that cannot be written keeps nothing,
        which the log says.
        """
        path = self._home / FOLDER / f"{self._name(texts)}.npy"
        if (vectors := _read(path, len(texts))) is not None:
            return vectors
        try:
            with self._alone(path.with_suffix(".lock")):
                if (vectors := _read(path, len(texts))) is None:
                    vectors = make(texts)
                    self._write(path, vectors)
        except OSError as error:
            log.info("the vectors of %d texts are not kept: %s", len(texts), error)
        return make(texts) if vectors is None else vectors

    @contextmanager
    def _alone(self, path: Path) -> Generator[None]:
        """Hold a lock that the other processes of this home wait for, but none for ever."""
        for folder in (self._home, path.parent):
            folder.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        ends = time.monotonic() + WAIT_S
        with open_private(path, "a") as file:
            while True:
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    if time.monotonic() >= ends:
                        break
                    time.sleep(TICK)
            yield

    def _write(self, path: Path, vectors: NDArray[np.float32]) -> None:
        with whole_file(path, private=True) as part, part.open("wb") as file:
            np.lib.format.write_array(file, vectors, allow_pickle=False)

    def _name(self, texts: Sequence[str]) -> str:
        return hashlib.sha256(json.dumps([self._encoder, *texts]).encode()).hexdigest()


def _read(path: Path, count: int) -> NDArray[np.float32] | None:
    """Return what a file holds; None if there is none, or it does not hold `count` vectors."""
    try:
        vectors = np.lib.format.read_array(io.BytesIO(read_limited(path, LARGEST)), allow_pickle=False)
    except (MareyError, ValueError):  # ValueError: its content
        return None
    whole = vectors.dtype == np.float32 and vectors.ndim == 2 and len(vectors) == count
    return vectors if whole and np.isfinite(vectors).all() else None
