"""A day of takes, as a person types it: submit with names and tags, find, keep, re-roll, fetch with a manifest."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx2
import pytest

from marey.client.manifest import COLUMNS
from tests.support.command import Command
from tests.support.live_api import QUALITY, LiveApi

TABLE = """prompt,name,tags,seed
a person walks,walk,show=nox; shot=010,5
a person waves,wave,show=nox; shot=020,6
a person bows,bow,,7
"""


@pytest.fixture
def job(api: LiveApi, marey: Command, tmp_path: Path) -> str:
    """Three motions, made."""
    table = tmp_path / "shots.csv"
    table.write_text(TABLE)
    job = marey("submit", "-f", table).ok().out.strip()
    api.work()
    return job


def motions(marey: Command, job: str, *more: object) -> list[dict[str, Any]]:
    return marey("motions", "list", "--job", job, "--json", *more).ok().lines


def manifest(folder: Path) -> list[dict[str, str]]:
    with (folder / "manifest.csv").open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_motions_are_found_by_tag_name_and_words(marey: Command, job: str) -> None:
    assert [m["name"] for m in motions(marey, job, "--tag", "shot=010")] == ["walk"]
    assert [m["name"] for m in motions(marey, job, "--tag", "show=nox", "--name", "WA")] == ["walk", "wave"]
    assert [m["name"] for m in motions(marey, job, "--text", "waving or bow")] == ["wave", "bow"]
    lines = marey("motions", "list", "--tag", "show=nox", "--tag", "shot=020", "--limit", 1).ok().out.splitlines()
    assert [line.split("\t")[1:] for line in lines] == [
        ["1", "wave", "show=nox; shot=020", "6", "", "2", "a person waves"]
    ]


def test_kept_motions_alone_are_fetched_with_a_manifest(marey: Command, job: str, tmp_path: Path) -> None:
    ids = {m["name"]: m["id"] for m in motions(marey, job)}
    marey("motions", "keep", "-", "--comment", "good", stdin=f"{ids['walk']}\n{ids['bow']}\n").ok()
    marey("motions", "reject", ids["wave"]).ok()
    marey("fetch", job, "-o", tmp_path / "k", "--review", "kept", "--name-template", "{name}_{seed}").ok()
    assert sorted(path.name for path in (tmp_path / "k").iterdir()) == [
        "bow_7.bvh", "bow_7.npz", "manifest.csv", "walk_5.bvh", "walk_5.npz",
    ]  # fmt: skip
    rows = manifest(tmp_path / "k")
    assert tuple(rows[0]) == COLUMNS
    told = ("index", "name", "tags", "prompt", "seed", "state", "review", "npz", "bvh", "licence", "comment")
    assert [rows[0][name] for name in told] == [
        "0", "walk", "show=nox; shot=010", "a person walks", "5", "succeeded", "kept", "walk_5.npz", "walk_5.bvh",
        "MIT", "good",
    ]  # fmt: skip
    assert [(row["name"], row["tags"]) for row in rows[1:]] == [("bow", "")]
    assert [m["name"] for m in motions(marey, job, "--review", "rejected", "--review", "new")] == ["wave"]
    marey("motions", "clear", ids["wave"]).ok()
    assert [m["name"] for m in motions(marey, job, "--review", "new")] == ["wave"]
    said = marey("fetch", job, "-o", tmp_path / "none", "--review", "rejected").ok().err
    assert "is rejected" in said


def test_a_reroll_keeps_everything_but_the_seed(api: LiveApi, marey: Command, job: str, tmp_path: Path) -> None:
    (walk,) = motions(marey, job, "--name", "walk")
    (take,) = marey("motions", "reroll", walk["id"], "--comment", "stiff", "--json").ok().lines
    assert (take["motion"], take["job"], take["seed"], take["made"]) == (walk["id"], job, 6, True)
    assert "asked for before; it is ready" in marey("motions", "reroll", walk["id"]).ok().out
    api.work()
    old, new = motions(marey, job, "--name", "walk")
    same = ("prompt", "name", "tags", "index", "bundle", "model")
    assert [new[name] for name in same] == [old[name] for name in same]
    assert (old["review"]["verdict"], old["review"]["by"], old["review"]["comment"]) == ("rerolled", "all", "stiff")
    assert (old["replaced_by"], new["replaces"], new["review"]) == (new["item"], old["id"], None)
    marey("fetch", job, "-o", tmp_path).ok()
    assert [(row["seed"], row["replaces"]) for row in manifest(tmp_path)] == [
        ("5", ""), ("6", ""), ("7", ""), ("6", old["id"]),
    ]  # fmt: skip


def test_the_quality_of_a_motion_arrives_everywhere(
    marey: Command, job: str, http: httpx2.Client, tmp_path: Path
) -> None:
    (item, *_) = http.get(f"/v1/jobs/{job}/items").json()["items"]
    quality = item["motion"]["quality"]
    assert quality == QUALITY.model_dump(mode="json")
    found = http.get(f"/v1/motions/{item['motion']['id']}").json()
    assert quality == found["quality"] == found["metadata"]["quality"]
    marey("fetch", job, "-o", tmp_path).ok()
    assert [row["quality"] for row in manifest(tmp_path)] == ["floating; popping"] * 3
    assert motions(marey, job)[0]["quality"] == quality


def test_a_motion_whose_bundle_is_gone_is_not_rolled_again(api: LiveApi, http: httpx2.Client, job: str) -> None:
    (motion, *_) = http.get("/v1/motions", params={"job": job}).json()["items"]
    with api.engine.begin() as conn:
        conn.exec_driver_sql("UPDATE item SET bundle = 'hgm3-gone@0123456789ab' WHERE id = %s", (motion["item"],))
    problem = http.post("/v1/motions/reroll", json={"motions": [motion["id"]]})
    assert (problem.status_code, problem.json()["type"]) == (409, "urn:marey:problem:conflict")
    assert "hgm3-gone" in problem.json()["detail"]
    assert http.get(f"/v1/jobs/{job}").json()["total"] == 3


def test_clips_of_two_jobs_share_a_folder_and_its_manifest(marey: Command, job: str, tmp_path: Path) -> None:
    other = marey("submit", "a person hops", "--seed", 1).ok().out.strip()
    for each in (job, other, job):
        marey("fetch", each, "-o", tmp_path / "clips").ok()
    assert [row["job"] for row in manifest(tmp_path / "clips")] == [other, job, job, job]
    (tmp_path / "clips" / "manifest.csv").write_text("mine,own\n")
    marey("fetch", job, "-o", tmp_path / "clips").refused(2, "manifest.csv", "not a manifest of fetched motions")
    assert (tmp_path / "clips" / "manifest.csv").read_text() == "mine,own\n"
    marey("fetch", job, "-o", tmp_path / "clips", "--overwrite").ok()
    assert len(manifest(tmp_path / "clips")) == 3


def test_tags_name_files_where_every_item_has_them(marey: Command, job: str, tmp_path: Path) -> None:
    template = "{tag[show]}_{tag[shot]}_{name}"
    marey("fetch", job, "-o", tmp_path / "a", "--name-template", template).refused(2, "has no tag show=…")
    for motion in motions(marey, job, "--tag", "show=nox"):
        marey("motions", "keep", motion["id"]).ok()
    marey("fetch", job, "-o", tmp_path / "b", "--review", "kept", "--name-template", template, "--format", "npz").ok()
    assert sorted(p.stem for p in (tmp_path / "b").glob("*.npz")) == ["nox_010_walk", "nox_020_wave"]


def test_nothing_of_it_is_another_tenants_or_a_readers(api: LiveApi, http: httpx2.Client, job: str) -> None:
    (motion, *_) = http.get("/v1/motions", params={"job": job}).json()["items"]
    for body in ({"motions": [str(uuid4())], "verdict": "kept"}, {"motions": [], "verdict": "kept"}, {"motions": [1]}):
        assert http.post("/v1/motions/review", json=body).status_code in (404, 422)
    with api.http("read") as reader:
        for route in ("review", "reroll"):
            body = {"motions": [motion["id"]], **({"verdict": "kept"} if route == "review" else {})}
            assert reader.post(f"/v1/motions/{route}", json=body).status_code == 403
    assert http.get(f"/v1/motions/{motion['id']}").json()["review"] is None


def test_an_id_that_is_none_says_where_it_stands(marey: Command) -> None:
    marey("motions", "keep", "-", stdin=f"{uuid4()}\nwalk\n").refused(3, "'walk'", "there is no such motion")
    marey("motions", "keep", uuid4()).refused(3, "there is no such motion")
