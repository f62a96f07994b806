"""One `marey serve` with two plug-ins and a language model for all tests of this folder, none of which breaks it.

The tests run in one process, also where others run beside it: see `pytest_xdist_make_scheduler`.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from marey.core import defaults
from tests.support.language_model import ChatRequest, CompletionReply, LanguageModel
from tests.support.marey import Marey, serving, tiny
from tests.support.models import add_text_bundles, random_bundle
from tests.support.plugin_wheels import install_plugins
from tests.support.prepared import write_prepared

TRAINED = "sway-starter"
"""The bundle of the model that a plug-in brings."""


@pytest.fixture(scope="package")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Marey]:
    """The command line with the plug-ins, a bundle that one of them trained, and one of the default model."""
    folder = tmp_path_factory.mktemp("extended")
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    marey = Marey(home, folder / "models", install_plugins(["toy_model", "toy_format"], folder))
    data, run = write_prepared(folder / "prepared"), folder / "run"
    trained = marey("train", "sway", "pose", data, "--run", run, "--side", "right", "--steps", 1).ok()
    assert trained.out.startswith("height = ")
    made = marey("train", "sway", "bundle", data, "--run", run, "-o", marey.models / TRAINED, "--side", "right").ok()
    assert made.out.startswith(f"{TRAINED}@")
    random_bundle(defaults.MODEL, marey.models / tiny(defaults.MODEL))
    add_text_bundles(marey.models)
    yield marey
    shutil.rmtree(home, ignore_errors=True)


@pytest.fixture(scope="package")
def language_model() -> Iterator[LanguageModel]:
    """A language model that repeats each prompt; a test may replace its answer."""

    def repeat(asked: ChatRequest, before: int) -> CompletionReply:
        return CompletionReply(asked.prompt)

    with LanguageModel(repeat) as served:
        yield served


@pytest.fixture(scope="package")
def served(installed: Marey, language_model: LanguageModel) -> Iterator[Marey]:
    """The command line with a server, whose worker and scheduler have the plug-ins and the language model."""
    settings = {
        "MAREY_REWRITER": "openai",
        "MAREY_REWRITER_URL": language_model.url,
        "MAREY_REWRITER_MODEL": "any",
        "MAREY_RETENTION_SECONDS": "1",
        "MAREY_LIVE_SLOTS": "0",
    }
    server = Marey(installed.home, installed.models, {**installed.environment, **settings})
    with serving(server):
        yield installed
