"""Edits of stored motions: requests, jobs, results, and what becomes of them when a source is erased."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from uuid import UUID, uuid4

import httpx2
import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict
from marey.db import transaction
from marey.jobs import cancel, claim, list_items, tables
from marey.motion.edits.operation import MOST_FRAMES
from marey.takes import Erasure, NewEdit, collect_garbage, delete, erase, rewrite_files, submit_edit
from marey.tenants import DEFAULT_TENANT, Quotas, create_key, create_tenant
from tests.integration.takes.test_retention import SECRET, dump, objects
from tests.servers.audit import audit
from tests.support.editing import clip_of, edited, stored, work_edits
from tests.support.live_api import LiveApi
from tests.support.walker import walker


def post(http: httpx2.Client, motion: str, *ops: object, **fields: object) -> httpx2.Response:
    return http.post(f"/v1/motions/{motion}/edits", json={"ops": [*ops], **fields})


def test_a_motion_is_edited_and_stored_with_what_it_was_made_from(api: LiveApi, http: httpx2.Client) -> None:
    source = stored(api, "a person walks to the left", name="hero", tags=["shot=010"])
    answer = post(http, source["id"], {"op": "trim", "from": 0.5, "to": "f30"}, {"op": "mirror"}, name="day 1")
    assert answer.status_code == 202, answer.text
    job = answer.json()
    assert answer.headers["location"] == f"/v1/jobs/{job['id']}"
    assert (job["kind"], job["state"], job["total"], job["name"]) == ("edit", "queued", 1, "day 1")
    work_edits(api)
    assert http.get(f"/v1/jobs/{job['id']}").json()["state"] == "succeeded"
    (item,) = http.get(f"/v1/jobs/{job['id']}/items").json()["items"]
    assert item["edits"] == {
        "ops": [{"op": "trim", "from": 0.5, "to": "f30"}, {"op": "mirror"}],
        "sources": [source["id"]],
    }
    motion = item["motion"]
    assert motion["edited_from"] == [source["id"]]
    assert (motion["name"], motion["tags"], motion["seed"]) == ("hero", ["shot=010"], source["seed"])
    assert motion["prompt"] == "a person walks to the right"
    assert (motion["licence"], motion["frames"], motion["fps"]) == ("MIT", 21, 20.0)
    assert (motion["model"], motion["bundle"]) == ("edit", "edit")
    assert motion["quality"]["flags"] is not None
    metadata = http.get(f"/v1/motions/{motion['id']}").json()["metadata"]
    (record,) = metadata["edited_from"]["sources"]
    npz = next(file for file in source["files"] if file["format"] == "npz")
    assert (record["name"], record["sha256"]) == (source["id"], npz["sha256"])
    assert metadata["edited_from"]["ops"] == item["edits"]["ops"]
    assert "marey" in metadata["edited_from"]["software"]
    clip = clip_of(api, motion["id"])
    assert clip.frames == 21
    assert clip.manifest["edited_from"] == metadata["edited_from"]
    assert {file["format"] for file in motion["files"]} == {"npz", "bvh"}
    assert http.get(f"/v1/motions/{source['id']}").json()["edited_from"] == []
    (found,) = http.get("/v1/motions", params={"text": "right", "tag": "shot=010"}).json()["items"]
    assert found["id"] == motion["id"]


def test_pieces_are_items_and_other_motions_follow_by_their_ids(api: LiveApi, http: httpx2.Client) -> None:
    first, second = stored(api, "a person walks"), stored(api, "a person waves")
    ops = ({"op": "split", "at": "f20"}, {"op": "concat", "with": second["id"], "blend": 0.1})
    pieces = edited(api, first["id"], *ops)
    assert [piece["index"] for piece in pieces] == [0, 1]
    assert [piece["frames"] for piece in pieces] == [21 + 40, 21 + 40]
    assert {piece["prompt"] for piece in pieces} == {"a person walks, then a person waves"}
    assert all(piece["edited_from"] == [first["id"], second["id"]] for piece in pieces)
    (whole,) = edited(api, pieces[0]["id"], {"op": "concat", "with": pieces[1]["id"]})
    assert whole["edited_from"] == [piece["id"] for piece in pieces]
    assert whole["frames"] == 121


@pytest.mark.parametrize(
    ("ops", "status", "where", "words"),
    [
        ([{"op": "explode"}], 422, "ops.0.op", "Known: trim"),
        ([{"op": "trim", "form": 1}], 422, "ops.0", "unknown parameter 'form' of trim"),
        ([{"op": "speed", "factor": 99}], 422, "ops.0.factor", "99 is not a number from 0.1 to 10"),
        ([{"op": "mirror"}, {"op": "concat", "with": "wave.npz"}], 422, "ops.1.with", "is not the id of a motion"),
        ([{"op": "concat"}], 422, "ops.0.with", "is missing"),
        ([], 422, "ops", "is empty"),
        ([{"op": "split", "at": 0.1}] * 6, 413, "ops.5", "6 splits make 64 pieces; the most is 32"),
    ],
)
def test_an_error_names_the_operation_and_what_is_allowed(
    http: httpx2.Client, api: LiveApi, ops: list[object], status: int, where: str, words: str
) -> None:
    source = stored(api)
    answer = post(http, source["id"], *ops)
    assert answer.status_code == status, answer.text
    assert where in answer.text
    assert words in answer.text


@pytest.mark.parametrize("model", [".", "../..", "/etc", "~", "/", "models/hgm3-open", ""])
def test_a_model_is_a_name_and_no_folder_of_the_server(api: LiveApi, http: httpx2.Client, model: str) -> None:
    answer = post(http, stored(api)["id"], {"op": "extend", "seconds": 1}, model=model)
    assert (answer.status_code, answer.json()["where"]) == (422, "model")
    assert "no bundle at" not in answer.text
    assert "manifest" not in answer.text


def test_settings_without_a_model_are_refused(api: LiveApi, http: httpx2.Client) -> None:
    answer = post(http, stored(api)["id"], {"op": "mirror"}, settings={"temperature": 0.7})
    assert (answer.status_code, answer.json()["where"]) == (422, "settings")


def test_a_repeated_edit_is_answered_when_its_motion_is_gone(api: LiveApi, http: httpx2.Client) -> None:
    source, headers = stored(api), {"Idempotency-Key": str(uuid4())}
    path, body = f"/v1/motions/{source['id']}/edits", {"ops": [{"op": "mirror"}]}
    first = http.post(path, json=body, headers=headers)
    assert first.status_code == 202, first.text
    with transaction(api.engine) as conn:
        delete(conn, DEFAULT_TENANT, UUID(source["job"]))
    second = http.post(path, json=body, headers=headers)
    assert (second.status_code, second.json()["id"]) == (202, first.json()["id"])
    assert second.headers["idempotency-replayed"] == "true"
    assert http.post(path, json=body).status_code == 404


def test_text_that_is_no_unicode_is_refused_with_an_idempotency_key_too(api: LiveApi, http: httpx2.Client) -> None:
    body = b'{"ops": [{"op": "concat", "with": "\\ud800"}]}'
    headers = {"Content-Type": "application/json", "Idempotency-Key": "broken"}
    answer = http.post(f"/v1/motions/{stored(api)['id']}/edits", content=body, headers=headers)
    assert (answer.status_code, answer.json()["where"]) == (422, "ops.0.with")


def test_motions_of_others_are_not_found(api: LiveApi, http: httpx2.Client) -> None:
    ours = stored(api)
    with transaction(api.engine) as conn:
        create_tenant(conn, "rival", Quotas())
        rival = create_key(conn, "rival", ["admin"], tenant="rival").secret
    with httpx2.Client(base_url=api.url, headers={"Authorization": f"Bearer {rival}"}) as theirs:
        answer = post(theirs, ours["id"], {"op": "mirror"})
        assert (answer.status_code, answer.json()["where"]) == (404, f"motion {ours['id']}")
    missing = str(uuid4())
    answer = post(http, ours["id"], {"op": "concat", "with": missing})
    assert (answer.status_code, answer.json()["where"]) == (404, "ops.0.with")
    with api.http("read") as reader:
        assert post(reader, ours["id"], {"op": "mirror"}).status_code == 403


def test_a_repeated_request_is_answered_with_the_first_job(api: LiveApi, http: httpx2.Client) -> None:
    source, other = stored(api), stored(api)
    http.headers["Idempotency-Key"] = str(uuid4())
    first = post(http, source["id"], {"op": "mirror"})
    again = post(http, source["id"], {"op": "mirror"})
    assert again.json()["id"] == first.json()["id"]
    assert again.headers["idempotency-replayed"] == "true"
    for refused in (post(http, other["id"], {"op": "mirror"}), post(http, source["id"], {"op": "reverse"})):
        assert refused.json()["type"].endswith("idempotency-mismatch")
    work_edits(api)
    with transaction(api.engine) as conn:
        assert len(list_items(conn, DEFAULT_TENANT, UUID(first.json()["id"])).rows) == 1


def test_quotas_and_limits_of_frames_and_licences_hold(api: LiveApi, http: httpx2.Client) -> None:
    source, other = stored(api), stored(api)
    with transaction(api.engine) as conn:
        conn.execute(sa.update(tables.motion).where(tables.motion.c.id == UUID(other["id"])).values(frames=MOST_FRAMES))
    answer = post(http, source["id"], {"op": "concat", "with": other["id"]})
    assert (answer.status_code, answer.json()["where"]) == (413, "ops")
    with transaction(api.engine) as conn:
        for row, licence in ((source, "CC-BY-SA-4.0"), (other, "CC-BY-NC-4.0")):
            values = {"licence": licence, "frames": 41}
            conn.execute(sa.update(tables.motion).where(tables.motion.c.id == UUID(row["id"])).values(values))
    answer = post(http, source["id"], {"op": "concat", "with": other["id"]})
    assert answer.status_code == 422
    assert "no licence satisfies both" in answer.text
    third = stored(api)
    (joined,) = edited(api, third["id"], {"op": "concat", "with": other["id"]})
    assert joined["licence"] == "CC-BY-NC-4.0"
    with transaction(api.engine) as conn:
        conn.execute(sa.text("UPDATE tenant SET max_queued = 1 WHERE id = 'default'"))
    try:
        answer = post(http, third["id"], {"op": "split", "at": 0.5})
        assert (answer.status_code, answer.json()["quota"]["name"]) == (429, "queued")
    finally:
        with transaction(api.engine) as conn:
            conn.execute(sa.text("UPDATE tenant SET max_queued = NULL WHERE id = 'default'"))


def test_an_operation_that_the_motion_does_not_allow_fails_its_item_alone(api: LiveApi, http: httpx2.Client) -> None:
    source = stored(api)
    job = post(http, source["id"], {"op": "split", "at": 0.5}, {"op": "trim", "from": 1.0}).json()
    late = post(http, source["id"], {"op": "split", "at": 99}, {"op": "mirror"}).json()
    work_edits(api)
    for item in http.get(f"/v1/jobs/{late['id']}/items").json()["items"]:
        assert (item["edits"]["ops"][0]["op"], item["error"]["where"]) == ("trim", "ops.0 (split)")
    good, bad = http.get(f"/v1/jobs/{job['id']}/items").json()["items"][::-1]
    assert (good["state"], bad["state"]) == ("succeeded", "failed")
    assert bad["error"]["where"] == "ops.1 (trim)"
    assert "after the end of the motion" in bad["error"]["message"]
    assert http.get(f"/v1/jobs/{job['id']}").json()["state"] == "partial"
    kinds = [event["kind"] for event in http.get(f"/v1/jobs/{job['id']}/events").json()["items"]]
    assert {"submitted", "progress", "item_failed"} <= {*kinds}


def test_an_edit_of_a_deleted_motion_fails_and_a_finished_one_stays(api: LiveApi, http: httpx2.Client) -> None:
    source = stored(api)
    (before,) = edited(api, source["id"], {"op": "mirror"})
    job = post(http, source["id"], {"op": "mirror"}).json()
    with transaction(api.engine) as conn:
        delete(conn, DEFAULT_TENANT, UUID(source["job"]))
    collect_garbage(api.engine, api.store)
    work_edits(api)
    (item,) = http.get(f"/v1/jobs/{job['id']}/items").json()["items"]
    assert (item["state"], item["error"]["type"]) == ("failed", "not-found")
    shown = http.get(f"/v1/motions/{before['id']}").json()
    assert shown["edited_from"] == [source["id"]]
    assert clip_of(api, before["id"]).frames == before["frames"]


def test_an_edit_is_not_drawn_again_and_is_retried_like_any_item(api: LiveApi, http: httpx2.Client) -> None:
    source = stored(api)
    (motion,) = edited(api, source["id"], {"op": "mirror"})
    answer = http.post("/v1/motions/reroll", json={"motions": [motion["id"]]})
    assert answer.status_code == 409
    assert "it is an edit" in answer.text
    job = post(http, source["id"], {"op": "reverse"}).json()
    with transaction(api.engine) as conn:
        cancel(conn, DEFAULT_TENANT, UUID(job["id"]))
    assert http.post(f"/v1/jobs/{job['id']}/retry").json()["counters"]["ready"] == 1
    work_edits(api)
    assert http.get(f"/v1/jobs/{job['id']}").json()["state"] == "succeeded"


def test_an_erased_prompt_is_gone_from_edits_of_edits_also_when_one_between_was_deleted(
    api: LiveApi, http: httpx2.Client
) -> None:
    prompt = f"a person walks to {SECRET}"
    source = stored(api, prompt)
    (middle,) = edited(api, source["id"], {"op": "mirror"})
    other = stored(api, "a person waves")
    (last,) = edited(api, other["id"], {"op": "concat", "with": middle["id"]})
    assert last["prompt"] == f"a person waves, then {prompt}"
    with transaction(api.engine) as conn:
        delete(conn, DEFAULT_TENANT, UUID(middle["job"]))
        file = tables.motion_file.c  # `work` stores the npz as every format
        conn.execute(sa.delete(tables.motion_file).where(file.motion_id == UUID(source["id"]), file.format == "bvh"))
    answer = http.post(f"/v1/jobs/{source['job']}/erase").json()
    assert (answer["edits"], answer["files_left"]) == ([last["job"]], 2)
    assert rewrite_files(api.engine, api.store) == 2
    collect_garbage(api.engine, api.store)
    assert SECRET not in dump(api.engine)
    assert not any(SECRET.encode(coding) in data for data in objects(api.store) for coding in ("utf-8", "utf-32-le"))
    clip = clip_of(api, last["id"])
    assert clip.manifest["erased"] is True
    record = clip.manifest["edited_from"]
    assert [each["name"] for each in record["sources"]] == [other["id"], middle["id"]]
    assert "sha256" not in repr(record)
    assert record["ops"] == [{"op": "concat", "blend": 0.25}]
    shown = http.get(f"/v1/motions/{last['id']}").json()
    assert shown["metadata"]["edited_from"] == record
    assert http.post(f"/v1/jobs/{source['job']}/erase").json()["edits"] == [last["job"]]
    (more,) = edited(api, last["id"], {"op": "reverse"})  # a motion without prompt is edited as any other
    assert more["prompt"] == ""
    assert http.get(f"/v1/jobs/{other['job']}").json()["erased"] is None


def test_erasure_waits_for_edits_that_are_open(api: LiveApi) -> None:
    source = stored(api, f"a person walks to {SECRET}")
    with transaction(api.engine) as conn:
        made = submit_edit(conn, NewEdit(UUID(source["id"]), [{"op": "mirror"}]))
    with pytest.raises(Conflict, match="queued") as refused, transaction(api.engine) as conn:
        erase(conn, DEFAULT_TENANT, UUID(source["job"]), by="ann")
    assert str(made.id) in (refused.value.where or "")
    work_edits(api)
    with transaction(api.engine) as conn:
        assert claim(conn, "edit", "w", 1) is None
        assert erase(conn, DEFAULT_TENANT, UUID(source["job"]), by="ann").edits == (made.id,)


def test_an_edit_under_way_is_found_by_an_erasure_beside_it_and_the_other_way_round(api: LiveApi) -> None:
    source = stored(api, f"a person walks to {SECRET}")
    (middle,) = edited(api, source["id"], {"op": "mirror"})
    job = UUID(source["job"])

    def erase_now() -> Erasure:
        with transaction(api.engine) as conn:
            return erase(conn, DEFAULT_TENANT, job, by="ann")

    def edit_now() -> UUID:
        with transaction(api.engine) as conn:
            return submit_edit(conn, NewEdit(UUID(middle["id"]), [{"op": "mirror"}])).id

    with ThreadPoolExecutor(1) as pool:
        with transaction(api.engine) as conn:
            made = submit_edit(conn, NewEdit(UUID(middle["id"]), [{"op": "reverse"}])).id
            erasing = pool.submit(erase_now)
            time.sleep(0.3)
            assert not erasing.done()
        with pytest.raises(Conflict, match="queued"):
            erasing.result(60)
        work_edits(api)
        with transaction(api.engine) as conn:
            assert set(erase(conn, DEFAULT_TENANT, job, by="ann").edits) == {UUID(middle["job"]), made}
            editing = pool.submit(edit_now)
            time.sleep(0.3)
            assert not editing.done()
        with pytest.raises(Conflict, match="has no npz to edit"):  # it waits for the file without the prompt
            editing.result(60)
    rewrite_files(api.engine, api.store)
    (item,) = edited(api, middle["id"], {"op": "mirror"})
    assert item["prompt"] == ""


def test_an_edit_is_noted_in_the_audit_log_and_the_tables_stay_sound(api: LiveApi, http: httpx2.Client) -> None:
    source = stored(api, clip=walker(seconds=1.0))
    post(http, source["id"], {"op": "mirror"})
    work_edits(api)
    with transaction(api.engine) as conn:
        noted = conn.execute(sa.text("SELECT verb, target FROM audit_event ORDER BY id DESC LIMIT 1")).one()
        assert tuple(noted) == ("motion.edit", source["id"])
        assert audit(conn) == []


def test_an_edit_is_checked_and_estimated_without_a_job(api: LiveApi, http: httpx2.Client) -> None:
    source = stored(api, "a person walks to the left")
    edited(api, source["id"], {"op": "mirror"})  # measures the bundle `edit`
    before = [job["id"] for job in http.get("/v1/jobs").json()["items"]]
    path, ops = f"/v1/motions/{source['id']}/edits?validate_only=true", [{"op": "mirror"}, {"op": "split", "at": "f20"}]
    answer = http.post(path, json={"ops": ops})
    assert answer.status_code == 200, answer.text
    checked = answer.json()
    assert (checked["valid"], checked["items"], checked["bundles"]) == (True, 2, ["edit"])
    assert checked["prompts"] == ["a person walks to the right"] * 2
    assert checked["estimate"]["items"] == 2
    assert checked["estimate"]["seconds"] is not None
    assert checked["waiting"] == 0
    for wrong, where in (({"op": "explode"}, "ops.0.op"), ({"op": "concat", "with": str(uuid4())}, "ops.0.with")):
        refused = http.post(path, json={"ops": [wrong]})
        assert (refused.status_code >= 400, refused.json()["where"]) == (True, where)
    assert http.post(f"/v1/motions/{uuid4()}/edits?validate_only=true", json={"ops": ops}).status_code == 404
    assert [job["id"] for job in http.get("/v1/jobs").json()["items"]] == before


def test_a_check_of_an_edit_knows_the_quota(api: LiveApi) -> None:
    tenant = f"t{uuid4().hex[:8]}"
    with transaction(api.engine) as conn:
        create_tenant(conn, tenant, Quotas(queued=3))
        secret = create_key(conn, tenant, ["admin"], tenant=tenant).secret
    with httpx2.Client(base_url=api.url, headers={"Authorization": f"Bearer {secret}"}) as theirs:
        job = theirs.post("/v1/jobs", json={"items": [{"prompt": "a person walks"}]}).json()["id"]
        api.work(walker().to_npz())
        (motion,) = theirs.get(f"/v1/jobs/{job}/motions").json()["items"]
        path = f"/v1/motions/{motion['id']}/edits?validate_only=true"
        split = {"op": "split", "at": 0.1}
        (quota,) = theirs.post(path, json={"ops": [split]}).json()["quotas"]
        assert (quota["name"], quota["asked"], quota["left"]) == ("queued", 2, 3)
        refused = theirs.post(path, json={"ops": [split, split]})
        assert (refused.status_code, refused.json()["type"]) == (429, "urn:marey:problem:quota")


def test_the_loop_of_a_timeline_is_found_by_the_prompt_of_its_frames(api: LiveApi, http: httpx2.Client) -> None:
    rows = [(0.0, 1.0, "a person bows"), (1.0, 6.05, "a person walks")]
    told = [{"start": start, "end": end, "prompt": prompt} for start, end, prompt in rows]
    text = "; ".join(f"{start:g}-{end:g} {prompt}" for start, end, prompt in rows)
    record = {"rows": told, "transitions": [], "gaps": []}
    about = {"prompts": [[0, rows[0][2]], [20, rows[1][2]]], "timeline": record}
    clip = walker(seconds=6.0, prompt=text)
    source = stored(api, text, clip=replace(clip, manifest={**clip.manifest, **about}))
    (loop,) = edited(api, source["id"], {"op": "loop"})
    metadata = http.get(f"/v1/motions/{loop['id']}").json()["metadata"]
    assert metadata["loop"]["source_frames"][0] > 20
    assert loop["prompt"] == metadata["prompt"] == "a person walks"
    (item,) = http.get(f"/v1/jobs/{loop['job']}/items").json()["items"]
    assert item["prompt"] == "a person walks"
    found = http.get("/v1/motions", params={"text": "walks"}).json()["items"]
    assert loop["id"] in [each["id"] for each in found]
    bows = http.get("/v1/motions", params={"text": "bows"}).json()["items"]
    assert [each["id"] for each in bows] == [source["id"]]
