"""Find a bundle by name, or list all installed bundles with the broken ones reported separately."""

from __future__ import annotations

import errno
import logging
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from marey.bundles.bundle import Bundle
from marey.bundles.manifest import MANIFEST_NAME
from marey.bundles.places import folders, how_to_get
from marey.core.characters import escape
from marey.core.errors import InvalidBundle, MareyError, NotFound, Refused
from marey.core.settings import Settings, settings

log = logging.getLogger(__name__)

MAX_LOGGED = 1000
MAX_REASON = 500  # characters: a manifest may hold numbers of 4,000 digits
Kind = Literal["generator", "labeller", "evaluator", "encoder"]


@dataclass(frozen=True)
class BrokenBundle:
    """A folder of bundles that cannot be used."""

    name: str
    """Name of the folder."""
    reason: str
    """Without a path: clients of the server see it."""
    error: MareyError

    @classmethod
    def of(cls, name: str, error: MareyError) -> BrokenBundle:
        """Describe an error of opening a bundle; keep the file's name, drop the parent folders."""
        file = Path(error.where).name if error.where else ""
        reason = f"{file}: {error.message}" if file and file != name else error.message
        return cls(_shown(name), _shown(reason)[:MAX_REASON], error)


@dataclass(frozen=True)
class Bundles:
    """The content of the folders of models."""

    found: tuple[Bundle, ...]
    """By folder; sizes are checked, hashes are not."""
    broken: tuple[BrokenBundle, ...]


def _shown(text: str) -> str:
    """Escape bytes that are not UTF-8, which file names may contain."""
    return text.encode("utf-8", "backslashreplace").decode()


def find_bundle(reference: str, *, config: Settings | None = None, verify: bool = True) -> Bundle:
    """Return a bundle by name (`hgm3-starter`), exact reference (`hgm3-starter@0123456789ab`) or path.

    Raises:
        NotFound: no folder of bundles has it.
        InvalidBundle: it is broken, or its weights differ from the exact reference.
        Refused: `MAREY_REQUIRE_LICENCE=commercial`, and its terms are non-commercial.
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


def list_bundles(*, config: Settings | None = None, kind: Kind | None = None) -> Iterator[Bundle]:
    """Return every readable bundle by folder, hashes not checked (use `find_bundle` for that).

    Broken ones are logged, each reason once, and left out; `scan_bundles` returns them too.
    """
    yield from scan_bundles(config=config, kind=kind).found


def scan_bundles(*, config: Settings | None = None, kind: Kind | None = None) -> Bundles:
    """Open every bundle in the model folders. A broken bundle does not hide the others."""
    found: dict[str, Bundle] = {}
    broken: dict[str, BrokenBundle] = {}
    for folder in folders(config or settings()):
        for path in _bundle_folders(folder):
            if path.name in found or path.name in broken:
                continue
            try:
                found[path.name] = Bundle.open(path, verify=False)
            except MareyError as error:
                broken[path.name] = BrokenBundle.of(path.name, error)
                log_broken(broken[path.name])
    chosen = tuple(bundle for bundle in found.values() if kind is None or bundle.manifest.kind == kind)
    return Bundles(chosen, tuple(broken.values()))


def has_bundle(name: str, config: Settings) -> bool:
    """Return True if a folder of that name holds a manifest, whole or broken."""
    return any(_is_bundle_folder(folder / name) for folder in folders(config))


_logged: set[tuple[str, str]] = set()


def log_broken(broken: BrokenBundle) -> None:
    """Log the reason why a bundle is skipped, once per reason."""
    key = (broken.name, str(broken.error))
    if key not in _logged and len(_logged) < MAX_LOGGED:
        _logged.add(key)
        where, message = escape(str(broken.error.where)), escape(broken.error.message)  # file names may hold any bytes
        log.warning("the bundle %r is left out: %s: %s", broken.name, where, message)


def _bundle_folders(folder: Path) -> list[Path]:
    """Yield folders that hold a manifest, and unreadable ones, by name; hidden folders belong to a `BundleWriter`."""
    try:
        paths = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except FileNotFoundError:
        return []
    except OSError as error:
        log.warning("the folder of models %s cannot be read: %s", folder, error.strerror)
        return []
    return [path for path in paths if _is_bundle_folder(path)]


def _is_bundle_folder(path: Path) -> bool:
    try:
        (path / MANIFEST_NAME).lstat()
    except OSError as error:
        if error.errno == errno.ENOENT:
            return path.is_symlink() and not path.exists()  # a link to nothing
        return error.errno not in (errno.ENOTDIR, errno.ENAMETOOLONG)
    except ValueError:  # a NUL in the name
        return False
    return True


def _locate(name: str, config: Settings) -> Path:
    if "/" in name or name.startswith("."):
        with suppress(OSError, RuntimeError):  # a name that no system has, a user that is not there
            path = Path(name).expanduser()
            if path.is_dir():
                return path
        raise NotFound(f"no bundle at {name}", hint="Give a folder that holds a manifest.json.")
    for folder in folders(config):
        if name and _is_bundle_folder(folder / name):
            return folder / name
    known = ", ".join(sorted({path.name for folder in folders(config) for path in _bundle_folders(folder)}))
    raise NotFound(
        f"no model bundle is named {name!r}",
        hint=f"Known here: {known or 'none'}. `marey models list` shows them; MAREY_MODELS names their folder."
        + how_to_get(name),
    )
