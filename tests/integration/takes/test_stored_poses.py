"""Constraints that name frames of stored motions and of files: read at submit, refused with the field."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import UUID, uuid4

import httpx2
import pytest
import sqlalchemy as sa

from marey.api.jobs import poses
from marey.api.making.processes import MakingProcess, MakingProcesses
from marey.client import Client
from marey.core.errors import InvalidInput
from marey.db import transaction
from marey.jobs import FailureReason, asset_key, tables
from marey.takes import delete
from marey.tenants import DEFAULT_TENANT, Quotas, create_key, create_tenant
from tests.support.command import Command
from tests.support.editing import clip_of, stored
from tests.support.live_api import LiveApi
from tests.support.walker import walker


def keyframe(motion: object, frame: int, at: int = 40, **fields: object) -> dict[str, Any]:
    return {"type": "pose_keyframe", "frame": at, "motion": {"id": str(motion), "frame": frame}, **fields}


def post(http: httpx2.Client, *constraints: dict[str, Any], **query: object) -> httpx2.Response:
    items = [{"prompt": "a person walks"}, {"prompt": "a person sits", "constraints": [*constraints]}]
    return http.post("/v1/jobs", json={"items": items}, params={name: str(value) for name, value in query.items()})


def problems(answer: httpx2.Response) -> list[tuple[int, str, str]]:
    assert answer.status_code == 422, answer.text
    return [(each["line"], each["field"], each["message"]) for each in answer.json()["problems"]]


def constraints_of(http: httpx2.Client, job: str) -> list[Any]:
    return [item["constraints"] for item in http.get(f"/v1/jobs/{job}/items").json()["items"]]


def test_frames_of_stored_motions_become_poses(
    api: LiveApi, http: httpx2.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, other = stored(api), stored(api, clip=walker(seconds=1))
    asked: list[str] = []
    whole = MakingProcesses.poses

    async def counted(self: MakingProcesses, frames: Any, npz: bytes, where: str) -> Any:
        asked.append(where)
        return await whole(self, frames, npz, where)

    monkeypatch.setattr(MakingProcesses, "poses", counted)
    answer = post(
        http,
        keyframe(source["id"], 7, 20),
        keyframe(source["id"], 9, 40, root_position=[0, 0.9, 1]),
        keyframe(other["id"].replace("-", ""), 7, 50, root_height=0.5),
    )
    assert answer.status_code == 202, answer.text
    first, found = constraints_of(http, answer.json()["id"])
    assert first is None
    clip = clip_of(api, source["id"])
    names = clip.skeleton.joint_names
    assert [each["frame"] for each in found] == [20, 40, 50]
    for each, frame in zip(found[:2], (7, 9), strict=True):
        assert "motion" not in each
        assert set(each["joint_rotations"]) == set(names)
        for name, turn in zip(names, clip.rotations[frame], strict=True):
            assert each["joint_rotations"][name] == pytest.approx([float(x) for x in turn])
    assert found[0]["root_height"] == pytest.approx(float(clip.root[7, 1]))
    assert (found[1]["root_position"], "root_height" in found[1]) == ([0, 0.9, 1], False)
    assert found[2]["root_height"] == 0.5
    assert sorted(asked) == sorted(f"motion {each['id']}" for each in (source, other))


def test_what_cannot_be_read_names_the_field(api: LiveApi, http: httpx2.Client) -> None:
    source, missing = stored(api), uuid4()
    for validate_only in (False, True):
        answer = post(http, keyframe(source["id"], 7, 1), keyframe(missing, 0), validate_only=validate_only)
        assert problems(answer) == [
            (2, "constraints.1.motion.id", "there is no such motion. `marey motions list` shows yours.")
        ]
    ((line, field, message),) = problems(post(http, keyframe(source["id"], 4000)))
    assert (line, field) == (2, "constraints.0.motion.frame")
    assert message == f"frame 4000 is beyond the motion, which has {source['frames']}"
    ((_, field, message),) = problems(post(http, keyframe("last", 0)))
    assert (field, "is not the id of a motion" in message) == ("constraints.0.motion.id", True)
    ((_, field, message),) = problems(
        post(http, {"type": "pose_keyframe", "frame": 4, "motion": {"file": "/etc/passwd", "frame": 0}})
    )
    assert (field, "a server reads no files" in message) == ("constraints.0.motion.file", True)
    assert http.get("/v1/jobs").json()["items"][0]["name"] is None


def test_motions_of_others_are_not_there(api: LiveApi, http: httpx2.Client) -> None:
    ours = stored(api)
    tenant = f"t{uuid4().hex[:8]}"
    with transaction(api.engine) as conn:
        create_tenant(conn, tenant, Quotas())
        secret = create_key(conn, tenant, ["admin"], tenant=tenant).secret
    with httpx2.Client(base_url=api.url, headers={"Authorization": f"Bearer {secret}"}) as theirs:
        ((_, field, message),) = problems(post(theirs, keyframe(ours["id"], 0)))
        assert (field, "no such motion" in message) == ("constraints.0.motion.id", True)
    assert post(http, keyframe(ours["id"], 0)).status_code == 202


def test_a_repeated_submit_is_answered_when_its_motion_is_gone(api: LiveApi, http: httpx2.Client) -> None:
    motion = stored(api)
    again = {"Idempotency-Key": str(uuid4())}
    body = {"items": [{"prompt": "a person walks", "seconds": 3, "constraints": [keyframe(motion["id"], 0)]}]}
    first = http.post("/v1/jobs", json=body, headers=again)
    assert first.status_code == 202, first.text
    with transaction(api.engine) as conn:
        delete(conn, DEFAULT_TENANT, UUID(motion["job"]))
    second = http.post("/v1/jobs", json=body, headers=again)
    assert (second.status_code, second.json()["id"]) == (202, first.json()["id"])
    assert second.headers["idempotency-replayed"] == "true"
    assert http.post("/v1/jobs", json=body).status_code == 422
    other = {"items": [{**body["items"][0], "seed": 7}]}
    assert http.post("/v1/jobs", json=other, headers=again).json()["type"].endswith("idempotency-mismatch")


def test_an_npz_that_is_gone_or_broken_is_a_problem_of_the_line(api: LiveApi, http: httpx2.Client) -> None:
    source = stored(api, clip=walker(seconds=1.5))
    npz = next(file for file in source["files"] if file["format"] == "npz")
    key = asset_key("default", npz["sha256"])
    whole = api.store.get(key)
    api.store.delete(key)
    ((_, field, message),) = problems(post(http, keyframe(source["id"], 0)))
    assert (field, "the motion was deleted" in message) == ("constraints.0.motion.id", True)
    api.store.put(key, whole)
    process = MakingProcess()
    try:
        broken, late = process.poses([0], b"no npz", "motion 1"), process.poses([0, 900], whole, "motion 1")
        assert isinstance(broken, FailureReason)
        assert isinstance(late, FailureReason)
        assert (broken.type, late.type) == ("conflict", "invalid-input")
        assert "the npz of the motion cannot be read" in broken.message
        assert "frame 900 is beyond the motion" in late.message
        assert process.alive
    finally:
        process.close()


def test_a_job_names_a_limited_number_of_motions_frames_and_keyframes(monkeypatch: pytest.MonkeyPatch) -> None:
    named = poses.NamedPoses()
    found = [each for _ in range(40) for each in named.add([keyframe(uuid4(), 0)], 3)]
    assert [(each.line, each.field) for each in found] == [(3, "constraints.0.motion.id")]
    assert f"of {poses.MOST_MOTIONS} motions at most" in found[0].message
    named, motion = poses.NamedPoses(), uuid4()
    found = [*named.add([keyframe(motion, frame) for frame in range(poses.MOST_FRAMES + 5)], 1)]
    assert [each.field for each in found] == [f"constraints.{poses.MOST_FRAMES}.motion.id"]
    monkeypatch.setattr(poses, "MOST_KEYFRAMES", 3)
    (over,) = poses.NamedPoses().add([keyframe(motion, 0)] * 5, None)
    assert over.field == "constraints.3.motion.id"


def test_submit_reads_files_and_short_references(
    api: LiveApi, http: httpx2.Client, marey: Command, tmp_path: Path
) -> None:
    source, newest = stored(api), stored(api, clip=walker(seconds=1))
    clip = clip_of(api, source["id"])
    (tmp_path / "poses").mkdir()
    clip.save_npz(tmp_path / "poses" / "pose.npz")
    file = tmp_path / "poses" / "constraints.json"
    named = {"type": "pose_keyframe", "frame": 10, "motion": {"file": "pose.npz", "frame": 5}}
    file.write_text(json.dumps([named, keyframe("last", 3, 30), keyframe(source["id"][-8:], 4, 50)]))
    ran = marey("submit", "a person walks", "--constraints", file, "--scope", "ignore")
    assert ran.code == 0, ran.err
    (found,) = constraints_of(http, ran.out.strip())
    for each, theirs, frame in zip(found, (clip, clip_of(api, newest["id"]), clip), (5, 3, 4), strict=True):
        assert each["joint_rotations"]["neck"] == pytest.approx(
            [float(x) for x in theirs.rotations[frame][theirs.skeleton.joint_names.index("neck")]]
        )
    for wrong, words in (
        ({"id": "ffffffff", "frame": 0}, "constraints.0.motion.id: there is no such motion"),
        ({"file": "none.npz", "frame": 0}, "constraints.0.motion.file: no such file"),
    ):
        file.write_text(json.dumps([{**named, "motion": wrong}]))
        ran = marey("submit", "a person walks", "--constraints", file)
        assert (ran.code, f"{file}: {words}" in ran.err) == (2, True), ran.err


def test_rows_name_motions_too(api: LiveApi, http: httpx2.Client, marey: Command, tmp_path: Path) -> None:
    source = stored(api)
    clip = clip_of(api, source["id"])
    replace(clip, manifest={**clip.manifest, "licence": source["licence"]}).save_npz(tmp_path / "pose.npz")
    file = tmp_path / "rows.jsonl"
    by_file = {"type": "pose_keyframe", "frame": 10, "motion": {"file": str(tmp_path / "pose.npz"), "frame": 5}}
    rows = [{"prompt": "a person walks", "constraints": [each]} for each in (by_file, keyframe("last", 5, 10))]
    file.write_text("\n".join(map(json.dumps, rows)))
    ran = marey("submit", "-f", file, "--scope", "ignore")
    assert ran.code == 0, ran.err
    first, second = constraints_of(http, ran.out.strip())
    assert first == second
    rows[1]["constraints"] = [keyframe("ffffffff", 5, 10)]
    rows[0]["constraints"] = [{**by_file, "motion": {"file": "none.npz", "frame": 5}}]
    file.write_text("\n".join(map(json.dumps, rows)))
    ran = marey("submit", "-f", file)
    assert ran.code == 2
    assert "line 1: constraints.0.motion.file: no such file" in ran.err
    assert "line 2: constraints.0.motion.id: there is no such motion" in ran.err
    with Client(api.url, api.key) as client, pytest.raises(InvalidInput) as refused:
        client.jobs.check(rows[:1])
    assert "constraints.0.motion.file" in str(refused.value)


def terms(api: LiveApi, motion: str, licence: str) -> None:
    """Let a stored motion have these terms."""
    with transaction(api.engine) as conn:
        conn.execute(sa.update(tables.motion).where(tables.motion.c.id == motion).values(licence=licence))


def test_poses_bring_the_terms_of_their_motion(
    api: LiveApi, http: httpx2.Client, marey: Command, tmp_path: Path
) -> None:
    closed, shared = stored(api), stored(api)
    terms(api, closed["id"], "CC-BY-NC-4.0")
    terms(api, shared["id"], "CC-BY-SA-4.0")
    answer = post(http, keyframe(closed["id"], 7), keyframe(closed["id"], 9, 50))
    assert answer.status_code == 202, answer.text
    _, found = constraints_of(http, answer.json()["id"])
    assert [each["licence"] for each in found] == ["CC-BY-NC-4.0"] * 2
    for validate_only in (False, True):
        answer = post(http, keyframe(closed["id"], 7), keyframe(shared["id"], 9, 50), validate_only=validate_only)
        ((line, field, message),) = problems(answer)
        assert (line, field) == (2, "constraints.1.licence")
        assert "no licence satisfies both" in message
    file = tmp_path / "poses.json"
    file.write_text(json.dumps([keyframe(closed["id"], 7), keyframe(shared["id"], 9, 50)]))
    ran = marey("submit", "a person walks", "--constraints", file, "--dry-run")
    assert (ran.code, "constraints.1.licence" in ran.err) == (2, True)
