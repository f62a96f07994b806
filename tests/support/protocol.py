"""Parts that the published protocol needs, in small: prepared data with enough test clips, an evaluator, and sizes."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from marey.bundles import Bundle
from marey.data.prepared import PreparedData
from marey.data.t2m_folder import T2MSet, prepare_t2m
from marey.evaluator import protocol
from marey.evaluator.protocol import ProtocolOptions
from marey.evaluator.t2m_import import import_t2m
from marey.importing import ImportRequest
from marey.motion.features import HUMANML3D_263, HeadingLayout
from tests.support.t2m_evaluator import SMALL, write_public_files
from tests.support.t2m_folder import write_folder_to_measure


def data_to_measure(folder: Path, kind: T2MSet) -> PreparedData:
    """Prepare a set of the published layout with 39 test clips."""
    prepare_t2m(kind, write_folder_to_measure(folder / "published", kind.layout), folder / "data")
    return PreparedData.open(folder / "data")


def small_evaluator(folder: Path, layout: HeadingLayout = HUMANML3D_263) -> Bundle:
    """Import a small T2M evaluator with random weights."""
    config = replace(SMALL, layout=layout.name, features=layout.dim, fps=layout.fps)
    import_t2m(
        ImportRequest("t2m-evaluator", write_public_files(folder / "files", config), folder / "t2m", "none"), config
    )
    return Bundle.open(folder / "t2m")


def measure_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the command generate five motions of each of two captions for the MModality, in place of 30 of 96."""
    monkeypatch.setattr(protocol, "ProtocolOptions", partial(ProtocolOptions, many=5, prompts=2, pairs=3))
