"""Plug-ins of a test: distributions that bring entry points and nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

from marey.exporters import exporters
from marey.exporters.registry import EXPORTERS
from marey.registry.models import MODELS
from marey.registry.training import TRAININGS


def write_distribution(folder: Path, name: str, modules: Mapping[str, str], entries: str) -> Path:
    """Write a distribution as `pip install --target` would.

    Args:
        folder: to put it in; a folder of the path of a process then.
        modules: source by name.
        entries: content of its `entry_points.txt`.
    """
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entries)
    for module, source in modules.items():
        (folder / f"{module}.py").write_text(source)
    return folder


@contextmanager
def installed(folder: Path) -> Iterator[None]:
    """Have the distributions of a folder installed in this process until the end of the block."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        forget()
        try:
            yield
        finally:
            forget()
    forget()


def forget() -> None:
    """Have every registry read its entry points again."""
    for registry in (MODELS, TRAININGS, EXPORTERS):
        registry.clear()
    exporters.cache_clear()
