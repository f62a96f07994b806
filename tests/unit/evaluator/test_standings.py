"""Actions of a bundle in its manifest and card."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from marey.bundles import find_bundle
from marey.core.settings import Settings
from marey.data.manifest import Clip, Measured
from marey.evaluator.standings import BEGIN, Learned, card_table, lists_of, record, share_of_copies, training_takes
from marey.referee.adherence import ActionRate, Standing
from marey.vocabulary.scope import ActionLists
from tests.support.evaluations import write_generator


def rate(action: str, standing: Standing, share: float = 0.9) -> ActionRate:
    return ActionRate(action, 10, 2, 4, 40, share, share - 0.1, min(1.0, share + 0.1), 0, standing)


RATES = [
    rate("walk", "supported", 0.95),
    rate("bow", "supported"),
    rate("kick", "tried", 0.5),
    rate("punch", "unjudged"),
    rate("swim", "tried", 0.0),
    rate("walk; wave", "supported"),
]
COPIES = {rate.action: 0.25 for rate in RATES}
TAKES = {"walk": 40, "bow": 2, "kick": 9, "punch": 5, "dance": 3, "fence": 2}


def clip(name: str, content: str, **fields: Any) -> Clip:
    measured = Measured(seconds=2, path=0, turn=0, speed=0, steps=0, side="")
    values = {
        "id": name, "start": 0, "length": 40, "joints_start": 0, "split": "train", "dataset": "cmu", "content": content,
        "style": "", "mirrored": False, "spliced": (), "acts": ("cmu",), "measured": measured, "captions": ("x",),
    }  # fmt: skip
    return Clip(**(values | fields))


def test_takes_are_captures_of_the_training_split() -> None:
    clips = [
        clip("08_01@0", "walk; turn-left"), clip("08_01@100", "walk"), clip("08_02@0", "walk - proud"),
        clip("M08_02@0", "walk", mirrored=True), clip("08_03@0", "walk", speed=1.15),
        clip("08_04@0", "walk", split="test"),
        clip("08_05@0", "walk", acts=("walk", "bow")), clip("g1@0", "wave", made=True), clip("g2@0", "wave", made=True),
    ]  # fmt: skip
    assert training_takes(clips) == {"walk": 2, "turn-left": 1, "wave": 1}


def test_lists_hold_what_is_supported_and_what_was_trained_in_vain() -> None:
    assert lists_of(RATES, TAKES) == ActionLists(("walk",), single_take=("bow",), tried=("dance", "kick", "punch"))


def test_a_motion_nearer_than_25_mm_is_a_copy() -> None:
    assert share_of_copies([("walk", 24.9), ("walk", 25.0), ("bow", 3.0)]) == {"walk": 0.5, "bow": 1.0}


def test_the_table_has_a_row_for_each_measured_action() -> None:
    rows = card_table(RATES, Learned(TAKES, COPIES)).splitlines()[3:-1]
    assert rows[0] == "| walk | 40 | 95% | 85% to 100% | 10 | 40 | 25% | supported |"
    assert [row.split(" | ")[1] for row in rows if "walk; wave" in row] == [""]
    assert [row.split(" | ")[1] for row in rows if row.startswith("| swim")] == ["none"]


def test_a_record_changes_manifest_and_card_and_keeps_the_weights(tmp_path: Path) -> None:
    write_generator(tmp_path, "toy-starter")
    config = Settings(home=tmp_path, models=tmp_path)
    before = find_bundle("toy-starter", config=config)
    (before.path / "README.md").write_text("# Toy\n\nText.\n", encoding="utf-8")
    for rates in (RATES[1:], RATES):  # the second record replaces the first
        record(before, rates, Learned(TAKES, COPIES))
    after = find_bundle("toy-starter", config=config)
    assert after.reference == before.reference
    assert after.manifest.actions == lists_of(RATES, TAKES)
    card = (after.path / "README.md").read_text(encoding="utf-8")
    assert card.startswith("# Toy\n\nText.\n\n## Actions\n")
    assert (card.count(BEGIN), card.count("| walk |")) == (1, 1)
