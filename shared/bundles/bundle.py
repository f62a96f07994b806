"""Loading a bundle, verified, and finding one by name."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from safetensors import SafetensorError
from safetensors.numpy import load as load_safetensors

from shared.bundles.manifest import MANIFEST_NAME, BundleManifest
from shared.errors import InvalidBundle, NotFound, Refused
from shared.hashing import sha256_of
from shared.settings import Settings, settings

MAX_MANIFEST_BYTES = 4 * 2**20
STATISTICS = "statistics"

Tensors = dict[str, NDArray[np.generic]]


class Bundle:
    """A verified bundle on disk. Make one with `Bundle.open` or `find_bundle`."""

    def __init__(self, path: Path, manifest: BundleManifest) -> None:
        self.path = path
        self.manifest = manifest

    @classmethod
    def open(cls, path: Path, *, verify: bool = True) -> Bundle:
        """Read the manifest and check every file's size and hash.

        Args:
            path: the bundle's folder.
            verify: check hashes too; sizes are always checked.

        Raises:
            InvalidBundle: a file is missing, truncated, changed or foreign.
        """
        bundle = cls(path, _read_manifest(path))
        for name, entry in bundle.manifest.files.items():
            file = path / name
            if not file.is_file():
                raise _broken(file, "the manifest names this file, but it is not there")
            if file.stat().st_size != entry.bytes:
                raise _broken(file, f"has {file.stat().st_size} bytes, the manifest says {entry.bytes}: truncated?")
            if verify and sha256_of(file) != entry.sha256:
                raise _broken(file, "its sha256 differs from the manifest's: the file was changed or damaged")
        return bundle

    @cached_property
    def weights_sha256(self) -> str:
        """One hash for all files: two bundles with the same hash generate the same motion."""
        lines = "\n".join(f"{name} {entry.sha256}" for name, entry in sorted(self.manifest.files.items()))
        return hashlib.sha256(lines.encode()).hexdigest()

    @property
    def reference(self) -> str:
        """The exact bundle, as stored with every item: `name@first 12 of the weights' hash`."""
        return f"{self.manifest.name}@{self.weights_sha256[:12]}"

    def tensors(self, part: str, *, dtype: type[np.floating] | None = np.float32) -> Tensors:
        """The tensors of one part, from all of its shards.

        Args:
            part: `tokenizer`, `masked`, …
            dtype: floating tensors are cast to this; None leaves them as stored (fp16).

        Raises:
            InvalidBundle: no such part, or a shard is not safetensors.
        """
        shards = self.manifest.parts.get(part)
        if shards is None:
            known = ", ".join(sorted(self.manifest.parts))
            raise InvalidBundle(f"has no part {part!r}", where=str(self.path), hint=f"Its parts are: {known}.")
        tensors: Tensors = {}
        for shard in shards:
            tensors.update(self._load_shard(self.path / shard))
        if dtype is not None:
            tensors = {
                name: value.astype(dtype) if np.issubdtype(value.dtype, np.floating) else value
                for name, value in tensors.items()
            }
        return tensors

    def statistics(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Mean and standard deviation (D,) the features were normalised with in training."""
        tensors = self.tensors(STATISTICS)
        return tensors["mean"].astype(np.float32), tensors["std"].astype(np.float32)

    def read_json(self, name: str) -> Any:
        """What `BundleWriter.add_json` wrote.

        Raises:
            InvalidBundle: no such file, or not JSON.
        """
        file = self.path / name
        if name not in self.manifest.files:
            raise InvalidBundle(f"has no file {name!r}", where=str(self.path))
        try:
            return json.loads(file.read_bytes())
        except (OSError, ValueError) as error:
            raise _broken(file, f"is not JSON: {error}") from error

    def _load_shard(self, file: Path) -> Tensors:
        try:
            return load_safetensors(file.read_bytes())
        except (SafetensorError, ValueError) as error:
            raise _broken(file, f"is not a safetensors file: {error}") from error


def find_bundle(reference: str, *, config: Settings | None = None, verify: bool = True) -> Bundle:
    """A bundle by name (`hgm3-starter`), exact reference (`hgm3-starter@0123456789ab`) or path.

    Raises:
        NotFound: no folder of bundles has it.
        InvalidBundle: it is there, but broken, or its exact weights are not those asked for.
        Refused: `MAREY_REQUIRE_LICENCE=commercial` and its terms are non-commercial.
    """
    config = config or settings()
    name, _, exact = reference.partition("@")
    bundle = Bundle.open(_locate(name, config), verify=verify)
    if exact and not bundle.weights_sha256.startswith(exact):
        raise InvalidBundle(
            f"the weights of {name!r} are {bundle.weights_sha256[:12]}, not {exact}",
            where=str(bundle.path),
            hint="The bundle was replaced since. Submit again without the exact version, or restore it.",
        )
    if config.require_licence == "commercial" and not bundle.manifest.commercial:
        raise Refused(
            f"the weights of {name!r} are under {bundle.manifest.licence}, which does not allow commercial use",
            where=str(bundle.path),
            hint="Choose another bundle, or unset MAREY_REQUIRE_LICENCE.",
        )
    return bundle


def list_bundles(
    *, config: Settings | None = None, kind: Literal["generator", "labeller", "evaluator"] | None = None
) -> Iterator[Bundle]:
    """Every readable bundle of the models folders, by name, hashes not checked (use `find_bundle` for that)."""
    config = config or settings()
    seen: set[str] = set()
    for folder in _folders(config):
        for path in sorted(folder.glob(f"*/{MANIFEST_NAME}")):
            if path.parent.name in seen:
                continue
            seen.add(path.parent.name)
            bundle = Bundle.open(path.parent, verify=False)
            if kind is None or bundle.manifest.kind == kind:
                yield bundle


def _folders(config: Settings) -> tuple[Path, ...]:
    return (config.models, config.home / "models")


def _locate(name: str, config: Settings) -> Path:
    if "/" in name or name.startswith("."):
        path = Path(name).expanduser()
        if path.is_dir():
            return path
        raise NotFound(f"there is no bundle at {name}", hint="Give a folder that holds a manifest.json.")
    for folder in _folders(config):
        if (folder / name / MANIFEST_NAME).is_file():
            return folder / name
    known = ", ".join(sorted(p.parent.name for f in _folders(config) for p in f.glob(f"*/{MANIFEST_NAME}")))
    raise NotFound(
        f"there is no model bundle named {name!r}",
        hint=f"Known here: {known or 'none'}. `marey models list` shows them; MAREY_MODELS names their folder.",
    )


def _read_manifest(path: Path) -> BundleManifest:
    file = path / MANIFEST_NAME
    try:
        if file.stat().st_size > MAX_MANIFEST_BYTES:
            raise _broken(file, f"is over {MAX_MANIFEST_BYTES} bytes")
        return BundleManifest.model_validate_json(file.read_bytes())
    except FileNotFoundError as error:
        raise _broken(path, f"has no {MANIFEST_NAME}: not a model bundle") from error
    except ValidationError as error:
        problems = "; ".join(f"{'.'.join(map(str, e['loc'])) or 'file'}: {e['msg']}" for e in error.errors()[:5])
        raise _broken(file, f"is not a manifest this version reads: {problems}") from error
    except (OSError, json.JSONDecodeError, UnicodeDecodeError) as error:
        raise _broken(file, f"cannot be read: {error}") from error


def _broken(file: Path, message: str) -> InvalidBundle:
    return InvalidBundle(message, where=str(file), hint="Fetch or import the bundle again.")
