"""Load files of `torch.save` safely: tensors and plain values alone, sizes first, and faults named."""

from __future__ import annotations

import pickle
import re
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.core.errors import InvalidFile, NotFound

MAX_BYTES = 4 * 2**30
"""Size of a checkpoint, and of its tensors unpacked. The largest known ones, of text encoders, have 1 GB."""
AGAIN = "Download the file again."
FOREIGN: Mapping[bytes, str] = {
    b"<!DOCTYPE": "is a web page, not a checkpoint: the download was refused or wants a confirmation",
    b"<html": "is a web page, not a checkpoint: the download was refused or wants a confirmation",
    b"version https://git-lfs": "is a pointer of Git LFS, not the file itself: run `git lfs pull`",
    b"\x1f\x8b": "is packed with gzip: unpack it first",
    b"Rar!": "is a RAR archive: unpack it first",
    b"7z\xbc\xaf": "is a 7z archive: unpack it first",
}
"""Beginnings of files that stand in for checkpoints after a failed download."""
REFUSED = re.compile(r"GLOBAL ([\w.]+)|[Cc]lass (?:<class ')?([\w.]+)|(?:global|function) ([\w.]+)")


def load_torch(file: Path, *, limit: int = MAX_BYTES) -> Mapping[str, Any]:
    """Load the dictionary of a file that `torch.save` wrote; tensors are mapped from disk where the format allows it.

    Args:
        file: .tar, .pt, .pth, .ckpt or .bin.
        limit: maximum bytes of the file, and of its tensors.

    Raises:
        NotFound: there is no such file.
        InvalidFile: over the limit, truncated, of another format, with Python objects, or no dictionary.
    """
    loaded = _load(file, limit)
    if not isinstance(loaded, Mapping) or not all(isinstance(key, str) for key in loaded):
        raise InvalidFile(f"holds {type(loaded).__name__}, not a dictionary of weights", where=str(file), hint=AGAIN)
    return loaded


def load_array(file: Path) -> NDArray[Any]:
    """Load a file that `torch.save` wrote of one tensor; floating numbers become float64.

    Raises:
        NotFound, InvalidFile: as `load_torch`, or it holds something else.
    """
    loaded = _load(file, MAX_BYTES)
    plain = isinstance(loaded, Tensor) and loaded.layout is torch.strided and loaded.device.type == "cpu"
    if not plain or loaded.is_quantized:
        raise InvalidFile(f"holds {type(loaded).__name__}, not one array of numbers", where=str(file), hint=AGAIN)
    return (loaded.double() if loaded.is_floating_point() else loaded).numpy(force=True)


def _load(file: Path, limit: int) -> Any:
    mapped = _check_format(file, limit)
    try:
        loaded: Any = torch.load(file, map_location="cpu", weights_only=True, mmap=mapped)
    except pickle.UnpicklingError as error:
        raise _refused(file, error) from None
    except Exception as error:  # a crafted or truncated file makes the reader raise nearly any exception
        raise InvalidFile(
            f"cannot be read: {_first_line(error)}", where=str(file), hint=f"It is truncated or damaged. {AGAIN}"
        ) from None
    _check_sizes(file, loaded, limit)
    return loaded


def _check_format(file: Path, limit: int) -> bool:
    """Refuse what is no checkpoint; return True for the zip format, which can be mapped."""
    try:
        if not file.is_file():
            if file.exists():
                raise InvalidFile("is not a regular file", where=str(file))
            raise NotFound("there is no such file", where=str(file), hint="Is the download complete?")
        size = file.stat().st_size
        if size > limit:
            raise InvalidFile(f"is over {limit:,} bytes", where=str(file), hint="Is it a checkpoint?")
        with file.open("rb") as stream:
            head = stream.read(512)
        if not zipfile.is_zipfile(file):
            _check_head(file, head)
            return False
        with zipfile.ZipFile(file) as archive:
            members = archive.infolist()
    except (OSError, zipfile.BadZipFile) as error:
        raise InvalidFile(f"cannot be read: {error}", where=str(file), hint=AGAIN) from None
    if not any(member.filename.endswith("data.pkl") for member in members):
        raise InvalidFile(
            "is a zip archive without a checkpoint in it",
            where=str(file),
            hint="Unpack it, and name the folder that it unpacks to.",
        )
    if any(member.compress_type != zipfile.ZIP_STORED for member in members):
        raise InvalidFile("is packed, as `torch.save` packs nothing", where=str(file), hint=AGAIN)
    return True


def _check_head(file: Path, head: bytes) -> None:
    foreign = next((said for start, said in FOREIGN.items() if head.lstrip().startswith(start)), None)
    if foreign is None and head[257:262] == b"ustar":
        foreign = "is a tar archive, not a checkpoint: unpack it first"
    if foreign is None and head.startswith(b"PK\x03\x04"):
        foreign = "is truncated"
    if foreign is None and not head.startswith(b"\x80"):  # a pickle, as older versions of torch wrote it
        foreign = "is no file of torch.save" if head else "is empty"
    if foreign is not None:
        raise InvalidFile(foreign, where=str(file), hint=AGAIN)


def _refused(file: Path, error: Exception) -> InvalidFile:
    """Return the error for a pickle with Python objects, or for a damaged one, which torch reports alike."""
    text = str(error)
    if found := REFUSED.search(text):
        return InvalidFile(
            f"holds code or objects of Python ({next(filter(None, found.groups()))}), which are never loaded",
            where=str(file),
            hint="Only state dicts can be imported. Take a file with tensors alone.",
        )
    return InvalidFile(
        f"cannot be read: {_first_line(error)}", where=str(file), hint=f"It is truncated or damaged. {AGAIN}"
    )


def tensors_in(value: object) -> Iterator[Tensor]:
    """Yield the tensors in nested plain values, each object once: a pickle may hold itself."""
    left, seen = [value], set[int]()
    while left:
        each = left.pop()
        if id(each) in seen:
            continue
        seen.add(id(each))
        if isinstance(each, Tensor):
            yield each
        elif isinstance(each, Mapping):
            left += each.values()
        elif isinstance(each, list | tuple | set):
            left += each


def _check_sizes(file: Path, loaded: object, limit: int) -> None:
    """Refuse tensors that claim more numbers than a file can hold: a stride of 0 repeats one without end."""
    if sum(each.numel() * each.element_size() for each in tensors_in(loaded)) > limit:
        raise InvalidFile(f"its tensors have over {limit:,} bytes", where=str(file), hint="Is it a checkpoint?")


def _first_line(error: Exception) -> str:
    return (str(error) or type(error).__name__).strip().splitlines()[0][:200]
