"""Text encoders in the layout of the models' hub: checked, installed beside bundles, and named by what reads them.

An installed encoder is a folder of that layout with a manifest: `transformers` reads it, its files are verified as
those of every bundle, and its identity is the hash of its weights (`marey.text.encoders.weights_sha256`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from marey.bundles import Bundle, TextSpec
from marey.core.errors import Conflict, NotFound
from marey.importing.encoder_files import write_encoder
from marey.importing.request import ImportRequest
from marey.text.encoders import WIDTHS, encoder_sha256, find_weights, weights_sha256
from marey.text.keys import NO_LABELLER


@contextmanager
def text_encoder_of(request: ImportRequest, name: str) -> Generator[TextSpec]:
    """Give the specification of the text encoder that imported weights were trained with, while a bundle is written.

    A folder that the request names is checked first; once the block is done, it is installed beside the bundle, under
    the encoder's name, unless this encoder is already installed. Without one, the installed encoder is named.

    ```python
    with text_encoder_of(request, "t5-v1_1-base") as text:
        return write_generator(request.output, …, text=text)
    ```

    Args:
        request: the import.
        name: of the encoder, as in `TextSpec`.

    Raises:
        NotFound: no encoder is given, and none is installed.
        InvalidFile: the folder holds another encoder, another version or width of it, or damaged files.
        Conflict: another version of this encoder is installed.
    """
    if request.text_encoder is None:
        yield spec_of(name, _installed_sha256(name, request))
        return
    folder = request.output.parent
    if (known := _same_installed(name, request.text_encoder, folder)) is not None:
        yield spec_of(name, known)
        return
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{name}-", dir=folder) as temporary:
        staged = write_encoder(name, request.text_encoder, Path(temporary) / name).path
        sha256 = weights_sha256(staged)
        installed = _find(name, folder)
        if installed is not None and weights_sha256(installed) != sha256:
            raise Conflict(
                f"another version of {name} is installed, which other bundles may need",
                where=str(installed),
                hint="Leave out --text-encoder to use that one, or write the bundle into another folder of models.",
            )
        yield spec_of(name, sha256)
        if installed is None:
            staged.rename(folder / name)


def import_encoder(request: ImportRequest) -> Bundle:
    """Import a text encoder, whose name is that of the kind; see `write_encoder` for errors."""
    return write_encoder(
        request.kind, request.folder, request.output, licence=request.licence, overwrite=request.overwrite
    )


def spec_of(name: str, sha256: str) -> TextSpec:
    """Return the text specification of imported weights: an encoder by hash, without graphs."""
    return TextSpec(
        encoder=name,  # pyright: ignore[reportArgumentType]  # pydantic checks it
        encoder_sha256=sha256,
        width=WIDTHS[name],
        labeller=NO_LABELLER,
    )


def _installed_sha256(name: str, request: ImportRequest) -> str:
    beside = request.output.parent / name
    if any(beside.glob("*.safetensors")):
        return weights_sha256(beside)
    try:
        return encoder_sha256(name)
    except NotFound as error:
        error.hint = f"Name the folder of its files with --text-encoder. {error.hint or ''}".strip()
        raise


def _same_installed(name: str, source: Path, beside: Path) -> str | None:
    """Return the hash of an installed encoder whose weights are, byte by byte, those of a folder; None = there is
    none."""
    installed = _find(name, beside)
    if installed is None or not any(source.glob("*.safetensors")):
        return None
    sha256 = weights_sha256(installed)
    return sha256 if weights_sha256(source) == sha256 else None


def _find(name: str, beside: Path) -> Path | None:
    """Return the folder of an installed encoder: beside the bundle first, then where encoders are searched."""
    if any((beside / name).glob("*.safetensors")):
        return beside / name
    try:
        return find_weights(name)
    except NotFound:
        return None
