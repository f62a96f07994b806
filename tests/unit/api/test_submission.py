"""Reading a submit does not do more work than its size is worth, whatever is wrong with it."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any
from uuid import UUID, uuid4

import pytest

from marey.api.catalogue import Catalogue
from marey.api.jobs import service
from marey.api.jobs.schemas import JobFields
from marey.api.jobs.service import MAX_MODELS, Submission, read_document, read_ndjson
from marey.core.errors import NotFound, TooLarge
from marey.core.settings import Settings
from marey.items.item import MAX_UNKNOWN
from marey.items.problems import InvalidItems
from marey.jobs.generators import GeneratorCapabilities
from tests.support.live_api import write_bundle


class Counting(Catalogue):
    """Counts how often a name is looked for, and how often in vain."""

    def __init__(self, config: Settings) -> None:
        super().__init__(config)
        self.asked = self.missed = 0

    def capabilities(self, name: str | None) -> GeneratorCapabilities:
        self.asked += 1
        try:
            return super().capabilities(name)
        except NotFound:
            self.missed += 1
            raise


@pytest.fixture
def catalogue(tmp_path: Path) -> Counting:
    write_bundle(tmp_path / "models")
    return Counting(Settings(models=tmp_path / "models", home=tmp_path / "home"))


def submit(catalogue: Catalogue, *items: dict[str, Any]) -> Submission:
    return read_document(io.BytesIO(json.dumps({"items": items}).encode()), catalogue)


def test_a_model_that_is_not_there_is_looked_for_once_and_told_of_each_line(catalogue: Counting) -> None:
    items = [{"prompt": "a person walks", "model": "nobody"}] * 500
    with pytest.raises(InvalidItems) as raised:
        submit(catalogue, {"prompt": "a person bows"}, *items)
    assert raised.value.total == 500
    assert [problem.line for problem in raised.value.problems[:2]] == [2, 3]
    assert catalogue.missed == 1


def test_a_job_has_one_bundle_of_a_model_though_another_may_come_while_it_is_read(catalogue: Counting) -> None:
    assert submit(catalogue, *[{"prompt": "a person walks"}] * 50).count == 50
    assert catalogue.asked == 1


def test_no_more_names_of_models_are_looked_for_than_a_job_may_have(catalogue: Counting) -> None:
    items = [{"prompt": "a person walks", "model": f"nobody-{number}"} for number in range(1000)]
    with pytest.raises(TooLarge, match=f"names over {MAX_MODELS} models") as raised:
        submit(catalogue, *items)
    assert raised.value.where == f"line {MAX_MODELS + 1}"
    assert catalogue.missed == MAX_MODELS


def test_blank_lines_without_end_are_not_read_to_their_end(
    catalogue: Counting, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service, "MAX_LINES", 10)
    good = b'{"prompt": "a person walks"}'
    assert read_ndjson(io.BytesIO(b"\n" * 9 + good), JobFields(), catalogue).count == 1
    with pytest.raises(TooLarge, match="has over 10 lines"):
        read_ndjson(io.BytesIO(b"\n" * 10 + good), JobFields(), catalogue)


def test_unknown_fields_without_end_are_told_in_one(catalogue: Counting) -> None:
    item = {"prompt": "a person walks", **dict.fromkeys(map(str, range(5000)))}
    with pytest.raises(InvalidItems) as raised:
        submit(catalogue, item)
    assert raised.value.total == MAX_UNKNOWN + 1
    assert "has 5000 unknown fields" in raised.value.problems[-1].message


def test_terms_of_poses_are_checked_without_reading_the_body_again(catalogue: Counting) -> None:
    closed, shared = uuid4(), uuid4()
    poses = {
        (motion, 0): {"joint_rotations": {}, "root_height": 0.9, "licence": licence}
        for motion, licence in ((closed, "CC-BY-NC-4.0"), (shared, "CC-BY-SA-4.0"))
    }

    def key(motion: UUID, frame: int) -> dict[str, Any]:
        return {"type": "pose_keyframe", "frame": frame, "motion": {"id": str(motion), "frame": 0}}

    rows = [[key(closed, 9)], [key(closed, 9), key(shared, 19)]]
    lines = [{"prompt": "a person walks", "constraints": row} for row in rows]
    body = io.BytesIO("\n".join(map(json.dumps, [*lines, {"prompt": "a person bows"}])).encode())
    submission = read_ndjson(body, JobFields(), catalogue)
    body.close()
    with pytest.raises(InvalidItems) as raised:
        submission.with_poses(poses)
    ((line, where),) = [(problem.line, problem.field) for problem in raised.value.problems]
    assert (line, where) == (2, "constraints.1.licence")
