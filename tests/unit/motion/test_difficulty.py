"""Heat maps of difficulty: the track under the poses, and the page with its numbers."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from marey.core.errors import InvalidInput
from marey.viz.difficulty import HARD, TALL, TOP, TokenDifficulty, draw_difficulty, normalized
from marey.viz.paper import THEMES
from marey.viz.render import CELL, MARGIN
from tests.support.walker import walker


def difficulty(hardest: int) -> TokenDifficulty:
    """Of a clip of 2 s, in tokens of 0.2 s."""
    values = np.zeros(10, np.float32)
    values[hardest] = 1
    return TokenDifficulty(values, 0.2)


def test_difficulties_are_scaled_within_a_motion() -> None:
    assert normalized(np.array([3.0, 1.0, 2.0], np.float32)).tolist() == [1, 0, 0.5]
    assert normalized(np.array([3.0, 3.0], np.float32)).tolist() == [0, 0]
    assert normalized(np.zeros(0, np.float32)).shape == (0,)


def test_the_hardest_token_is_the_darkest_place_of_the_track_under_its_own_time(tmp_path: Path) -> None:
    clip = walker()
    seconds = clip.seconds / 10
    found = {}
    for hardest in (2, 7):
        made = replace(difficulty(hardest), seconds=seconds)
        draw_difficulty([clip], [made], tmp_path / "a.png", captions=["a person walks"], columns=5)
        with Image.open(tmp_path / "a.png") as image:
            pixels = np.asarray(image.convert("RGB"))
        _, columns = np.nonzero((pixels == HARD).all(-1))
        found[hardest] = (columns.min() - MARGIN, columns.max() - MARGIN)
        assert (pixels == THEMES["light"].floor).all(-1).any()
    frame = 4 * CELL[0] / (clip.frames - 1)  # pixels; the first and the last pose stand over the track's ends
    token = seconds * clip.fps * frame
    for hardest, (left, right) in found.items():
        assert left == pytest.approx(CELL[0] / 2 + token * hardest, abs=2)
        assert right == pytest.approx(CELL[0] / 2 + token * (hardest + 1), abs=3)


def test_the_sheet_is_the_contact_sheet_with_one_more_track(tmp_path: Path) -> None:
    clips = [walker(), walker()]
    heights = []
    for count in (1, 2):
        draw_difficulty(clips[:count], [difficulty(0)] * count, tmp_path / "a.png", captions=["a"] * count, columns=3)
        with Image.open(tmp_path / "a.png") as image:
            heights.append(image.height)
    assert heights[1] - heights[0] > CELL[1] + TALL + TOP


def test_the_page_names_the_number_of_each_token_and_runs_nothing_of_a_prompt(tmp_path: Path) -> None:
    path = draw_difficulty(
        [walker()], [difficulty(3)], tmp_path / "a.html", captions=["<script>alert(1)</script>"], columns=3
    )
    page = path.read_text(encoding="utf-8")
    tokens = re.findall(r"<title>token (\d+), ([\d.]+) s: ([\d.]+)</title>", page)
    assert [int(number) for number, _, _ in tokens] == list(range(10))
    assert tokens[3] == ("3", "0.60", "1.00")
    assert f'fill="rgb{HARD}"' in page
    assert "<script>alert" not in page
    assert "data:image/png;base64," in page


@pytest.mark.parametrize("name", ["a.gif", "a"])
def test_another_ending_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InvalidInput, match=r"into a \.png or \.html, not "):
        draw_difficulty([walker()], [difficulty(0)], tmp_path / name, captions=["a"])
