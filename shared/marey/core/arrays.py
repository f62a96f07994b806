"""Read arrays of foreign files (npy, npz, safetensors). Pickles are never loaded; kinds, shapes, sizes and finite
numbers are checked, and every fault is an error of `marey.core.errors`."""

from __future__ import annotations

import io
import sys
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile, MareyError, NotFound, TooLarge

MAX_UNPACKED = 2**30
"""Limit on the unpacked bytes of an npz file that is read whole."""
PACKED = frozenset({zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED})
"""Compression methods that numpy writes. bzip2 and LZMA unpack whole blocks, whatever size a member declares: 600
bytes became a gigabyte."""
CHUNK = 2**22
"""Numbers per step of the check for finite values: a mapped file is not read into memory at once."""

Array = NDArray[Any]
Shape = tuple[int | None, ...]


def check_array(
    array: Array, name: str, where: str, *, kinds: str, shape: Shape, finite: bool = True, hint: str | None = None
) -> Array:
    """Check kind, shape and values of an array, and return it.

    Args:
        array: the array to check.
        name: its name in messages.
        where: the file.
        kinds: letters of `numpy.dtype.kind` that are allowed (`f` floating, `iu` whole numbers, `b`, `U`), or one
            dtype's name (`float16`).
        shape: length of each axis; None = any length.
        finite: refuse NaN and infinite numbers.
        hint: advice for the error.

    Raises:
        InvalidFile: a check failed.
    """
    is_name = kinds[-1].isdigit()
    if array.dtype.name != kinds if is_name else array.dtype.kind not in kinds:
        raise InvalidFile(f"`{name}` holds {array.dtype}", where=where, hint=hint)
    if array.ndim != len(shape) or any(s is not None and s != n for s, n in zip(shape, array.shape, strict=True)):
        wanted = "(" + ", ".join("any" if s is None else str(s) for s in shape) + ")"
        raise InvalidFile(f"`{name}` has shape {array.shape}, not {wanted}", where=where, hint=hint)
    if array.dtype.kind == "U" and not _is_text(array):
        raise InvalidFile(f"`{name}` holds text that is not Unicode", where=where, hint=hint)
    if finite and array.dtype.kind in "fc" and not _is_finite(array):
        raise InvalidFile(f"`{name}` holds NaN or infinite numbers", where=where, hint=hint)
    return array


def _is_text(array: Array) -> bool:
    """Return True if all characters are some: numpy keeps any number, of which Python makes no text."""
    codes = np.frombuffer(array.tobytes(), f"{array.dtype.byteorder.replace('=', '').replace('|', '')}u4")
    return bool((codes <= sys.maxunicode).all())


def map_npy(path: Path, *, hint: str | None = None) -> Array:
    """Map an npy file into memory, read-only.

    Raises:
        NotFound: there is no such file.
        InvalidFile: not an npy file (or a renamed npz file), truncated, or with Python objects.
    """
    try:
        if not path.is_file():
            if path.exists():
                raise InvalidFile("is not a regular file", where=str(path), hint=hint)
            raise NotFound("there is no such file", where=str(path), hint=hint)
        return np.lib.format.open_memmap(path, mode="r")
    except MareyError:
        raise
    except Exception as error:  # a crafted header makes numpy raise nearly any exception
        raise InvalidFile(_reason(error, "npy"), where=str(path), hint=hint) from None


def read_npy(path: Path, *, limit: int = MAX_UNPACKED, hint: str | None = None) -> Array:
    """Read a whole npy file.

    Raises:
        NotFound, InvalidFile: as `map_npy`, or over `limit` bytes.
    """
    data = read_bytes(path, limit=limit, hint=hint)
    try:
        return np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except Exception as error:
        raise InvalidFile(_reason(error, "npy"), where=str(path), hint=hint) from None


def read_npz(
    path: Path, names: Collection[str], *, limit: int = MAX_UNPACKED, hint: str | None = None
) -> dict[str, Array]:
    """Read arrays of an npz file by name.

    Raises:
        NotFound: there is no such file.
        InvalidFile, TooLarge: as `parse_npz`.
    """
    return parse_npz(read_bytes(path, limit=limit, hint=hint), str(path), names, limit=limit, hint=hint)


def parse_npz(
    data: bytes, where: str, names: Collection[str], *, limit: int = MAX_UNPACKED, hint: str | None = None
) -> dict[str, Array]:
    """Read arrays of an npz file's bytes by name; sizes are checked before anything is unpacked.

    Raises:
        InvalidFile: not an npz file, broken, with Python objects, or without one of the arrays.
        TooLarge: it unpacks to more than `limit` bytes.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if any(member.compress_type not in PACKED for member in members):
                raise InvalidFile("is packed by a method that numpy does not use", where=where, hint=hint)
            size = sum(member.file_size for member in members)
            if size > limit:
                raise TooLarge(
                    f"{size / 2**30:.1f} GiB unpacked, over the limit of {limit / 2**30:g} GiB", where=where, hint=hint
                )
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            missing = [name for name in names if name not in file.files]
            if missing:
                raise InvalidFile(f"has no {', '.join(missing)}", where=where, hint=hint)
            arrays = {name: file[name] for name in names}
    except MareyError:
        raise
    except Exception as error:  # a crafted zip or header makes zipfile and numpy raise nearly any exception
        raise InvalidFile(_reason(error, "npz"), where=where, hint=hint) from None
    foreign = [name for name, value in arrays.items() if not isinstance(value, np.ndarray)]
    if foreign:  # numpy returns a member that is not an npy file as bytes
        raise InvalidFile(f"`{foreign[0]}` is not an array", where=where, hint=hint)
    return arrays


def parse_safetensors(
    data: bytes, where: str, *, error: type[InvalidFile] = InvalidFile, hint: str | None = None
) -> dict[str, Array]:
    """Read the tensors of a safetensors file's bytes.

    Raises:
        InvalidFile: not a safetensors file, or with number types that numpy does not have.
    """
    from safetensors.numpy import load

    try:
        return load(data)
    except Exception as failure:  # SafetensorError, and KeyError or TypeError for unknown number types
        raise error(f"is not a safetensors file: {failure}", where=where, hint=hint) from None


def text_of(array: Array, name: str, where: str) -> str:
    """Return the text of an array that holds one string.

    Raises:
        InvalidFile: it holds anything else.
    """
    try:
        return str(check_array(array, name, where, kinds="U", shape=())[()])
    except ValueError:  # invalid code points
        raise InvalidFile(f"`{name}` is not text", where=where) from None


def _is_finite(array: Array) -> bool:
    if array.size <= CHUNK or array.ndim == 0:
        return bool(np.isfinite(array).all())
    rows = max(1, CHUNK // max(1, array[0].size))
    return all(bool(np.isfinite(array[low : low + rows]).all()) for low in range(0, len(array), rows))


def _reason(error: Exception, kind: str) -> str:
    if "pickle" in str(error) or "Python objects" in str(error):
        return "holds pickled objects, which are never loaded"
    return f"is not a valid {kind} file"
