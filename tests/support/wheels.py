"""Wheels, and environments of their own to run them in: the checkout is closed to every Python process of these."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.support.marey import REPOSITORY

SECONDS = 120.0
DEVELOPMENT = Path(sysconfig.get_path("purelib"))
"""Packages of the development environment, without the editable install: a `.pth` file does not read another."""
INSTALL = (
    *(str(DEVELOPMENT.parents[2] / "bin" / "uv"), "pip", "install", "-q"),
    *("--no-deps", "--no-index", "--no-cache", "--no-config"),
)
"""Install wheels: those of its arguments alone."""
CLOSE = """
import os, sys

CLOSED, OPEN = {closed!r}, {open!r}

def refuse(event, arguments):
    if event in ("open", "os.listdir", "os.scandir") and isinstance(arguments[0], str):
        path = os.path.abspath(arguments[0])
        if path.startswith(CLOSED) and not path.startswith(OPEN):
            raise PermissionError("the checkout is closed to this environment: " + path)

sys.addaudithook(refuse)
"""


def this_wheel(factory: pytest.TempPathFactory) -> Path:
    """The wheel of this tree: built once a run, whichever process of the run asks first."""
    base = factory.getbasetemp()
    run = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder = run / "wheel-of-this-tree"
    with (run / "wheel-of-this-tree.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return next(folder.glob("*.whl"), None) or build_wheel(REPOSITORY, folder)


def build_wheel(tree: Path, folder: Path) -> Path:
    """Build the wheel of a tree."""
    project = tree / "pyproject.toml"
    assert project.is_file()
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    return wheel


@dataclass(frozen=True)
class Environment:
    """A virtual environment."""

    folder: Path

    @property
    def packages(self) -> Path:
        """The folder of its packages."""
        return next(self.folder.glob("lib/python*/site-packages"))

    @property
    def python(self) -> str:
        """Its interpreter."""
        return str(self.folder / "bin" / "python")

    @property
    def marey(self) -> str:
        """The command that the wheel brings."""
        return str(self.folder / "bin" / "marey")

    def environ(self, values: Mapping[str, str]) -> dict[str, str]:
        """Variables of its processes: none of the caller's own settings, no path to the checkout."""
        dropped = ("MAREY_", "PYTHON", "VIRTUAL_ENV")
        kept = {name: value for name, value in os.environ.items() if not name.startswith(dropped)}
        return {**kept, **values}


def install_from_index(folder: Path, requirements: Iterable[str], *, seconds: float) -> Environment:
    """Make an environment whose pip installs these and what they require, from the package index."""
    _run([sys.executable, "-m", "venv", str(folder)])
    made = Environment(folder)
    _run([made.python, "-m", "pip", "install", "-q", *requirements], seconds)
    _close_checkout(made, made.folder)
    return made


def make_environment(folder: Path, wheels: Iterable[Path], *, borrow: bool) -> Environment:
    """Make an environment with these wheels.

    Args:
        borrow: the packages of the development environment too; else what the wheels' own requirements name, copied
            from there, and nothing else.
    """
    _run([sys.executable, "-m", "venv", "--without-pip", str(folder)])
    made = Environment(folder)
    if names := [str(wheel) for wheel in wheels]:
        _run([*INSTALL, "--python", made.python, *names])
    if borrow:
        (made.packages / "borrowed.pth").write_text(f"{DEVELOPMENT}\n")
    else:
        _copy_requirements(made)
    _close_checkout(made, DEVELOPMENT.parents[2] if borrow else made.folder)
    return made


def _close_checkout(made: Environment, allowed: Path) -> None:
    """Close the checkout to Python processes of an environment, but for one folder."""
    closing = CLOSE.format(closed=f"{REPOSITORY}/", open=f"{allowed}/")
    (made.packages / "sitecustomize.py").write_text(closing)


def _copy_requirements(made: Environment) -> None:
    """Copy the distributions that the installed wheels require, and what these require."""
    copied: set[str] = set()
    todo = [text for info in made.packages.glob("*.dist-info") for text in _required(info.parent, info.name)]
    while todo:
        requirement = Requirement(todo.pop())
        if requirement.name in copied or (requirement.marker and not requirement.marker.evaluate({"extra": ""})):
            continue
        copied.add(requirement.name)
        found = distribution(requirement.name)
        for file in found.files or ():
            source = Path(str(found.locate_file(file)))
            if source.is_file() and source.is_relative_to(DEVELOPMENT):  # compiled files too: they start faster
                target = made.packages / file
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source, target)
        todo += found.requires or []


def _required(packages: Path, name: str) -> list[str]:
    from importlib.metadata import Distribution

    return Distribution.at(packages / name).requires or []


def _run(command: list[str], seconds: float = SECONDS) -> None:
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    assert done.returncode == 0, done.stderr


def install_into(folder: Path, wheels: Iterable[Path]) -> None:
    """Install wheels into a folder that is no environment, for a path of Python."""
    _run([*INSTALL, "--target", str(folder), *map(str, wheels)])


def bundles_wheel(family: str, models: Path, folder: Path) -> Path:
    """Build `marey-bundles-FAMILY` of other bundles than the checkout's.

    Args:
        models: a folder with a bundle for each that the distribution holds, by the same folder's name.
        folder: where the wheel and its tree are written.
    """
    tree = folder / "models"
    shutil.copytree(REPOSITORY / "models" / "packages" / family, tree / "packages" / family)
    for bundle in models.iterdir():
        (tree / bundle.name).symlink_to(bundle)
    return build_wheel(tree / "packages" / family, folder / "wheel")
