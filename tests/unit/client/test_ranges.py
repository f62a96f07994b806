"""Ranges of models: checked before anything is sent, where the model is installed beside the client."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from marey.client.rows import PromptReader, read_rows
from tests.support.plugins import installed, write_distribution

DANCER = """\
from marey.registry import LengthLimits, ModelSpec, Setting
SPEC = ModelSpec(
    "dancer", "", "", handler="a:b", load="a:b", limits=LengthLimits(1.0, 8.0),
    settings=(Setting("steps", 1, 100, 10, whole=True), Setting("heat", 0.5, 2.0, 1.0)),
)
"""


@pytest.fixture
def dancer(tmp_path: Path) -> Iterator[None]:
    """Install the model."""
    with installed(
        write_distribution(
            tmp_path, "dancer", {"dancer_ranges": DANCER}, "[marey.models]\ndancer = dancer_ranges:SPEC\n"
        )
    ):
        yield


def row(**values: Any) -> dict[str, Any]:
    return {"prompt": "a person dances", "model": "dancer", **values}


def problems(reader: PromptReader) -> list[str]:
    """All problems of a reader that was read."""
    return [str(problem) for problem in reader.error().problems]


def test_every_row_is_held_against_its_model(dancer: None) -> None:
    rows = [
        row(seconds=8.0, settings={"steps": 8.0, "heat": 2}),
        row(seconds=9.0, settings={"heat": 2.5, "steps": 2.5}),
        row(settings={"steps": 0, "heat": 1}),
    ]
    reader = read_rows(rows)
    items = list(reader)
    assert problems(reader) == [
        "line 2: seconds: 9 is outside 1 to 8 seconds, the range of dancer",
        "line 2: settings: steps: is 2.5, not a whole number",
        "line 2: settings: heat: 2.5 is outside 0.5 to 2",
        "line 3: settings: steps: 0 is outside 1 to 100",
    ]
    assert reader.total == 4
    # What was told here is not sent for the server to tell again.
    assert [(item.seconds, dict(item.settings)) for item in items] == [
        (8.0, {"steps": 8.0, "heat": 2.0}), (None, {}), (None, {"heat": 1.0}),
    ]  # fmt: skip


def test_options_of_the_command_are_held_against_it_too(dancer: None) -> None:
    reader = read_rows([{"prompt": "walk"}], {"model": "dancer", "settings": {"heat": 9.0}})
    list(reader)
    assert problems(reader) == ["line 1: settings: heat: 9 is outside 0.5 to 2"]


@pytest.mark.parametrize(
    "values",
    [
        {"model": "stranger", "seconds": 50.0, "settings": {"heat": 900.0}},
        {"model": "dancer-starter", "seconds": 50.0, "settings": {"heat": 900.0}},
        {"model": None, "seconds": 50.0, "settings": {"heat": 900.0}},
        {"settings": {"of_a_newer_version": 900.0, "fps": 60.0}},
    ],
)
def test_what_is_not_known_here_is_left_to_the_server(dancer: None, values: dict[str, Any]) -> None:
    (item,) = read_rows([row(**values)])
    assert dict(item.settings) == values["settings"]
    assert item.seconds == values.get("seconds")


def test_a_model_without_limits_leaves_lengths_to_the_server(tmp_path: Path) -> None:
    source = DANCER.replace(" limits=LengthLimits(1.0, 8.0),", "")
    with installed(write_distribution(tmp_path, "free", {"free": source}, "[marey.models]\ndancer = free:SPEC\n")):
        (item,) = read_rows([row(seconds=50.0)])
    assert item.seconds == 50.0


def test_a_range_must_hold_a_length(tmp_path: Path) -> None:
    from marey.registry import LengthLimits

    for low, high in ((0.0, 1.0), (2.0, 1.0), (1.0, float("inf"))):
        with pytest.raises(ValueError, match="no motion has"):
            LengthLimits(low, high)
