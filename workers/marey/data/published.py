"""Parts of readers of data sets that are published as features, with their own captions, splits and statistics."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.core.arrays import check_array, read_npy
from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile, NotFound
from marey.data.folder import LEAST_STD
from marey.data.manifest import Measured
from marey.motion.features import FeatureLayout

Float32 = NDArray[np.float32]

SPLITS = ("train", "val", "test")
MAX_TEXT = 2**28
"""Largest size of a text file in bytes."""
UNREADABLE, FEW = 0.01, 2
"""Listed clips that may have no file or one with NaN: a share, or a clip and its mirror image. HumanML3D's own scripts
leave out two of 29,232."""


@dataclass
class LeftOut:
    """Listed clips that are not used.

    Attributes:
        reasons: why, by clip.
        missing: those that have no file.
        spoiled: those with a file that holds NaN or infinite numbers.
    """

    reasons: dict[str, str] = field(default_factory=dict[str, str])
    missing: list[str] = field(default_factory=list[str])
    spoiled: list[str] = field(default_factory=list[str])

    def miss(self, name: str, file: str) -> None:
        """Leave out a clip without one of its files."""
        self.missing.append(name)
        self.reasons[name] = f"there is no {file}"

    def spoil(self, name: str, file: str) -> None:
        """Leave out a clip whose features are no numbers."""
        self.spoiled.append(name)
        self.reasons[name] = f"{file} holds NaN or infinite numbers"

    def check(self, listed: int, *, where: Path, hint: str) -> None:
        """Check that few of the listed clips are unreadable.

        Raises:
            NotFound, InvalidFile: too many have no file, or hold NaN.
        """
        unreadable = [*self.missing, *self.spoiled]
        if len(unreadable) <= max(FEW, UNREADABLE * listed):
            return
        error = NotFound if self.missing else InvalidFile
        message = f"{self.reasons[unreadable[0]]}; {len(unreadable)} of {listed} clips cannot be read"
        raise error(message, where=str(where), hint=hint)


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text file, without spaces around them and without the mark with which some editors begin
    a file. Signs that only some programs take for the end of a line, such as U+2028, do not end one.

    Raises:
        NotFound: there is no such file.
        InvalidFile: it is not UTF-8.
        TooLarge: it is larger than `MAX_TEXT`.
    """
    try:
        text = read_bytes(path, limit=MAX_TEXT).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidFile(f"is not UTF-8: {error.reason}", where=str(path)) from None
    return [line.strip() for line in io.StringIO(text, newline=None)]


def read_statistics(mean: Path, std: Path, width: int) -> tuple[Float32, Float32]:
    """Return the published mean and deviation (D,); a deviation of zero, that of a constant, becomes `LEAST_STD`.

    Raises:
        NotFound, InvalidFile: one is missing, or has another shape, NaN or a negative deviation.
    """
    arrays = [
        check_array(read_npy(path), path.stem, str(path), kinds="f", shape=(width,)).astype(np.float32)
        for path in (mean, std)
    ]
    if (arrays[1] < 0).any():
        raise InvalidFile("holds a negative deviation", where=str(std))
    return arrays[0], np.maximum(arrays[1], np.float32(LEAST_STD))


def measure(features: Float32, layout: FeatureLayout, unit: float, turn: float) -> Measured:
    """Measure the travel of features (T, D), and count how often a toe comes to stand.

    Args:
        features: not normalized.
        layout: theirs.
        unit: metres in one unit of the features.
        turn: degrees by which the motion turns, positive to the left.
    """
    seconds = len(features) / layout.fps
    path = unit * float(np.linalg.norm(features[:, layout.slices["velocity"]].astype(np.float64), axis=1).sum())
    toes = layout.contacts(features)[:, 1::2]
    return Measured(
        seconds=round(seconds, 2),
        path=round(path, 2),
        turn=round(turn, 1) + 0.0,
        speed=round(path / seconds, 2),
        steps=int((toes[1:] & ~toes[:-1]).sum()),
        side="",
    )
