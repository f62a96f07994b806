"""Stage 1 of data preparation: convert BVH files with `dataset.toml` and `index.csv` to a joints pack."""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.core.children import end_with_parent
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.data.archive import bvh_files
from marey.data.caption_files import CaptionFile, read_caption_files
from marey.data.dataset import DATASET, INDEX, SETS, Dataset, known_set, read_dataset
from marey.data.floor import follow_floor, on_floor
from marey.data.index import UNUSED, Row, read_index
from marey.data.pack import JointsPack, PackClip
from marey.data.retarget import FPS, read_source, retarget
from marey.motion.io.bvh import parse_bvh

Progress = Callable[[int, int | None], None]
"""Called with the number of finished files and the total, or None if unknown."""
MOST_KINDS = 5
"""Kinds of members without clips that are named."""
LEAST_FRAMES = 4
LEAST_RISE = 0.001
"""Metres by which hips rise and fall at least in a file that holds their height."""


@dataclass(frozen=True)
class CaptureSet:
    """A set of captures: its path, its description, and the content of each clip."""

    path: Path
    dataset: Dataset
    rows: tuple[Row, ...]
    caption_files: tuple[CaptionFile, ...] = ()

    @classmethod
    def known(cls, name: str, path: Path) -> CaptureSet:
        """Open a known set in an archive or folder, with the packaged index and captions, or those of the folder.

        Raises:
            NotFound, InvalidFile: the set is unknown, its index is missing, or a caption file is broken.
        """
        dataset = known_set(name)
        own = SETS / name / INDEX
        if own.is_file():
            rows = read_index(own, dataset.model_copy(update={"columns": {}}))
            return cls(path, dataset, rows, read_caption_files(own.parent, rows))
        rows = read_index(path / INDEX, dataset)
        return cls(path, dataset, rows, read_caption_files(path, rows))

    def captions_of(self, row: Row) -> tuple[tuple[str, ...], ...]:
        """Captions of a row by each author; those of the index come first and count as one author."""
        authors = (row.captions, *(file.captions.get(row.id, ()) for file in self.caption_files))
        return tuple(said for said in authors if said)

    @classmethod
    def own(cls, folder: Path) -> CaptureSet:
        """Open a folder with its own `dataset.toml`, `index.csv` and optional `captions-*.csv`.

        Raises:
            NotFound, InvalidFile: one of them is missing or broken.
        """
        if not (folder / DATASET).is_file():
            raise NotFound(
                f"there is no {DATASET} in this folder",
                where=str(folder),
                hint="Write one: docs/tutorials/train-your-own.md has an example.",
            )
        dataset = read_dataset(folder / DATASET)
        rows = read_index(folder / INDEX, dataset)
        return cls(folder, dataset, rows, read_caption_files(folder, rows))


def pack_set(
    captures: CaptureSet,
    *,
    processes: int = 2,
    progress: Progress | None = None,
    note: Callable[[str], None] | None = None,
) -> JointsPack:
    """Retarget every clip of a set.

    Args:
        captures: the set to read.
        processes: number of worker processes.
        progress: called for each file.
        note: called with a sentence on the members of an archive that were passed over, if there are any.

    Raises:
        NotFound, InvalidFile, TooLarge: the source cannot be read; the message names the file.
        InvalidInput: no clip is left.
    """
    dataset = captures.dataset
    rows, left_out = _wanted(captures)
    clips: list[tuple[PackClip, NDArray[np.float32]]] = []
    done = set[str]()
    passed_over = Counter[str]()
    files = ((name, data) for name, data in bvh_files(captures.path, passed_over) if name in rows)
    for name, joints in _retarget_all(files, dataset, processes):
        done.add(name)
        for row in rows[name]:
            piece = _segment(joints, row, dataset.index_fps)
            if len(piece) < LEAST_FRAMES:
                left_out[row.id] = f"fewer than {LEAST_FRAMES} frames"
            else:
                clips.append((_clip(row, captures), piece))
        if progress:
            progress(len(done), len(rows))
    if note and passed_over:
        note(f"{captures.path}: {_counted(passed_over)}.")
    _check_complete(captures, rows.keys() - done)
    if not clips:
        raise InvalidInput("no clip is left", where=str(captures.path))
    return JointsPack.of(
        sorted(clips, key=lambda pair: pair[0].id),
        [dataset.terms],
        left_out,
        {f"{dataset.name}/{file.name}": file.sha256 for file in captures.caption_files},
    )


def _wanted(captures: CaptureSet) -> tuple[dict[str, list[Row]], dict[str, str]]:
    """Return the rows to convert, by file, and why each of the others is left out, by id."""
    rows, left_out, largest = defaultdict[str, list[Row]](list), dict[str, str](), captures.dataset.largest_error_cm
    for row in captures.rows:
        if row.error_cm > largest:
            left_out[row.id] = f"off what was captured by more than {largest:g} cm"
        elif row.action == UNUSED:
            left_out[row.id] = f"not to be used: {row.facts}" if row.facts else "not to be used"
        else:
            rows[row.stem].append(row)
    return rows, left_out


def _check_complete(captures: CaptureSet, missing: Collection[str]) -> None:
    if missing:
        more = f" ({len(missing)} missing)" if len(missing) > 1 else ""
        raise InvalidFile(f"holds no {min(missing)}.bvh, which the index lists{more}", where=str(captures.path))


def _counted(passed_over: Counter[str]) -> str:
    """Say how many members were passed over, and of which kinds, the most frequent first."""
    frequent = passed_over.most_common(MOST_KINDS)
    kinds = [f"{count:,} {kind}" for kind, count in frequent]
    if others := passed_over.total() - sum(count for _, count in frequent):
        kinds.append(f"{others:,} others")
    return f"{passed_over.total():,} members that are not BVH files were passed over ({', '.join(kinds)})"


def _clip(row: Row, captures: CaptureSet) -> PackClip:
    return PackClip(
        id=row.id,
        dataset=captures.dataset.name,
        content=row.action,
        style=row.style,
        split=row.split,
        start=0,
        frames=0,
        source=row.source,
        captions=captures.captions_of(row),
        side=row.side,
        in_place=row.in_place,
        facts=row.facts,
        tier=row.tier or "",
        licence=row.licence,
        credit=row.credit,
    )


def _segment(joints: NDArray[np.float32], row: Row, fps: float) -> NDArray[np.float32]:
    """Select the frames of a row; the floor is that of the whole take."""
    first = 0 if row.start is None else round(row.start * FPS / fps)
    last = len(joints) if row.end is None else round((row.end - 1) * FPS / fps) + 1
    return joints[first:last]


def _retarget_all(
    files: Iterable[tuple[str, bytes]], dataset: Dataset, processes: int
) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Retarget in worker processes, with a bounded number of files in memory (an archive unpacks to 548 MB)."""
    files = iter(files)
    if processes <= 1:
        yield from (retarget_file(name, data, dataset) for name, data in files)
        return
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with ProcessPoolExecutor(processes, initializer=end_with_parent) as pool:
        while batch := list(islice(files, 64)):
            names, contents = zip(*batch, strict=True)
            yield from pool.map(retarget_file, names, contents, [dataset] * len(batch), chunksize=8)


def retarget_file(name: str, data: bytes, dataset: Dataset) -> tuple[str, NDArray[np.float32]]:
    """Retarget a BVH file of a set; return its name and joints (T, 22, 3) on the floor."""
    where = f"{name}.bvh"
    clip = parse_bvh(data, where=where, unit=dataset.unit, up=dataset.up)
    rig = dataset.rig_of(clip.skeleton.joint_names, where)
    source = read_source(clip, rig, where=where, unit=dataset.unit)
    joints = retarget(source, rig, unit=dataset.unit)
    if np.ptp(source.joints[:, 0, 1]) < LEAST_RISE:
        joints = follow_floor(joints)
    return name, on_floor(joints, dataset.floor).astype(np.float32)
