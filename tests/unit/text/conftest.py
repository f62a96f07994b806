"""Tiny encoders with random weights, saved to disk in the published layouts."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.tiny_encoders import write_tiny_clip, write_tiny_distilbert, write_tiny_t5


@pytest.fixture(scope="session")
def tiny_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """CLIP's text tower, 512 wide, two layers, random weights."""
    return write_tiny_clip(tmp_path_factory.mktemp("clip"))


@pytest.fixture(scope="session", params=["t5-base", "t5-v1_1-base"])
def tiny_t5(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """T5's encoder, 768 wide, two layers, random weights, with the feed-forward that tells the two apart."""
    return request.param, write_tiny_t5(request.param, tmp_path_factory.mktemp(request.param))


@pytest.fixture(scope="session")
def tiny_distilbert(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """DistilBERT, 768 wide, two layers, random weights."""
    return write_tiny_distilbert(tmp_path_factory.mktemp("distilbert"))
