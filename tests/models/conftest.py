"""One thread for small networks; a prepared folder of swinging stick figures with made-up text features: small, but in
the real format."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import torch

from marey.data.prepared import PreparedData
from tests.support.prepared import write_prepared
from tests.support.texts import pipelines_share_parts


@pytest.fixture(autouse=True, scope="session")
def _one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(autouse=True, scope="module")
def _shared_parts() -> Iterator[None]:
    with pipelines_share_parts():
        yield


@pytest.fixture(scope="session")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    """The prepared folder, open."""
    return PreparedData.open(write_prepared(tmp_path_factory.mktemp("data") / "prepared"))
