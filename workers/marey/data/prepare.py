"""Stage 1 of preparing data: an archive of BVH files as it is published, to a joints pack."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from marey.core.documents import read_json
from marey.core.errors import InvalidFile, NotFound
from marey.data.archive import bvh_files
from marey.data.pack import JointsPack, PackClip
from marey.data.retarget import read_source, retarget
from marey.data.rigs import BANDAI_NAMCO, ICLONE, RIGS, Rig
from marey.data.sources import cmu_split
from marey.motion.io.bvh import parse_bvh

Progress = Callable[[int, int | None], None]
"""Called with how many clips are done, and how many there are, when that is known."""

_NAME = re.compile(r"dataset-(?P<set>[12])_(?P<content>[a-z-]+)_(?P<style>[a-z-]+)_(?P<take>\d+)")


class Splits(BaseModel):
    """`bandai-namco-splits.json`: clip names by split; pairs that occur in `compositional` only."""

    model_config = ConfigDict(extra="ignore")

    compositional_pairs: list[tuple[str, str, str]]
    train: list[str]
    val: list[str]
    test: list[str]
    compositional: list[str]

    @classmethod
    def load(cls, path: Path) -> Splits:
        """Read the file.

        Raises:
            NotFound: no such file.
            InvalidFile: another shape, or a clip in two splits.
        """
        try:
            splits = cls.model_validate(read_json(path))
        except NotFound:
            raise NotFound(
                "no split file", where=str(path), hint="Give it with --splits, or put it next to the archive."
            ) from None
        except ValidationError as error:
            raise InvalidFile(f"not a split file: {error.errors()[0]['msg']}", where=str(path)) from error
        if len(splits.by_clip()) != sum(map(len, (splits.train, splits.val, splits.test, splits.compositional))):
            raise InvalidFile("a clip is listed in two splits", where=str(path))
        return splits

    def by_clip(self) -> dict[str, str]:
        """Split of each clip."""
        return {name: split for split in ("train", "val", "test", "compositional") for name in getattr(self, split)}


def pack_bandai_namco(
    source: Path, *, splits: Path | None = None, processes: int = 2, progress: Progress | None = None
) -> JointsPack:
    """Retarget the Bandai-Namco Research Motion Dataset (`.tar.xz` or unpacked).

    Args:
        source: archive or folder.
        splits: split file; by default `bandai-namco-splits.json` beside the source.
        processes: how many retarget at once.
        progress: called for each clip.

    Raises:
        NotFound, InvalidFile, TooLarge: what is wrong with the source or the splits, with the clip's name.
    """
    split_of = Splits.load(splits or source.parent / "bandai-namco-splits.json").by_clip()

    def label(name: str) -> PackClip:
        match = _NAME.fullmatch(name)
        if match is None:
            raise InvalidFile("the name has not the form dataset-N_CONTENT_STYLE_TAKE", where=name)
        if name not in split_of:
            raise InvalidFile("is in no split", where=name, hint="The split file belongs to another release.")
        content = f"{match['set']}/{match['content']}"
        return PackClip(name, "bandai-namco", content, match["style"], split_of[name], 0, 0)

    return _pack(source, BANDAI_NAMCO, label, processes, progress)


def pack_cmu(
    source: Path, *, captions: Path | None = None, processes: int = 2, progress: Progress | None = None
) -> JointsPack:
    """Retarget the CMU trials on the iClone rig; contents are CMU's own descriptions, splits are made by name hash.

    Args:
        source: archive or folder.
        captions: by default `cmu-captions.json` beside the source.

    Raises:
        NotFound, InvalidFile, TooLarge: what is wrong, with the trial's name.
    """
    path = captions or source.parent / "cmu-captions.json"
    try:
        table = {name: str(row["description"]) for name, row in read_json(path).items()}
    except NotFound:
        raise NotFound(
            "no caption file", where=str(path), hint="Give it with --captions, or put it next to the archive."
        ) from None
    except (KeyError, TypeError, AttributeError) as error:
        raise InvalidFile("not a table of trials with descriptions", where=str(path)) from error

    def label(name: str) -> PackClip:
        if name not in table:
            raise InvalidFile("the trial has no description", where=name)
        return PackClip(f"cmu_{name}", "cmu", table[name], "", cmu_split(name), 0, 0)

    return _pack(source, ICLONE, label, processes, progress)


def _pack(
    source: Path, rig: Rig, label: Callable[[str], PackClip], processes: int, progress: Progress | None
) -> JointsPack:
    clips: list[tuple[PackClip, NDArray[np.float32]]] = []
    for name, joints in _retarget_all(bvh_files(source), rig, processes):
        clips.append((label(name), joints))
        if progress:
            progress(len(clips), None)
    return JointsPack.of(sorted(clips, key=lambda pair: pair[0].id))


def _retarget_all(
    files: Iterable[tuple[str, bytes]], rig: Rig, processes: int
) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Retarget in worker processes, a bounded number of files in flight (the archive unpacks to 548 MB)."""
    files = iter(files)
    if processes <= 1:
        yield from (_retarget_file(name, data, rig.name) for name, data in files)
        return
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with ProcessPoolExecutor(processes) as pool:
        while batch := list(islice(files, 64)):
            names, contents = zip(*batch, strict=True)
            yield from pool.map(_retarget_file, names, contents, [rig.name] * len(batch), chunksize=8)


def _retarget_file(name: str, data: bytes, rig_name: str) -> tuple[str, NDArray[np.float32]]:
    rig = RIGS[rig_name]
    clip = parse_bvh(data, where=f"{name}.bvh")
    return name, retarget(read_source(clip, rig, where=f"{name}.bvh"), rig).astype(np.float32)
