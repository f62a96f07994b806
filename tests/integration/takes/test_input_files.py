"""From a table of prompts to a folder of clips and back: problems with lines, names of any script, old folders."""

from __future__ import annotations

import csv
import json
import unicodedata
from pathlib import Path

import pytest
import sqlalchemy as sa

from marey.client.csv_cells import restore
from marey.client.manifest import NAME, RAW_COLUMNS
from marey.core.characters import find_forbidden
from marey.db import transaction
from marey.jobs import tables
from tests.support.command import Command
from tests.support.live_api import LiveApi

NAMES = ("Zoë", "日本 散歩", "Szene 3: auf?", "a.b", "名" * 100)


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / NAME).open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def clips(folder: Path) -> dict[str, float]:
    return {
        path.relative_to(folder).as_posix(): path.stat().st_mtime
        for path in folder.rglob("*")
        if path.suffix in (".npz", ".bvh", ".part")
    }


def test_ranges_of_a_bundle_are_told_beside_what_cannot_be_parsed(api: LiveApi, marey: Command, tmp_path: Path) -> None:
    table = tmp_path / "shots.csv"
    table.write_bytes(
        "\ufeffprompt;seconds;seed;model\r\n"
        '"a person\r\nwalks";12;;\r\n'  # 2 and 3: longer than the bundle makes
        "\r\n"
        ";20;;\r\n"  # 5: no prompt, and too long
        "a person bows;soon;x;\r\n"  # 6: two fields
        "a person runs;0.6;;nobody\r\n"  # 7: no such model
        "a person hops;3;;\r\n".encode()
    )
    for more in ((), ("--dry-run",)):
        ran = marey("submit", "-f", table, *more).refused(
            2,
            f"{table}: 6 problems",
            "line 2: seconds: 12 is outside 0.8 to 9.8 seconds",
            "line 5: prompt: the prompt is empty",
            "line 5: seconds: 20 is outside 0.8 to 9.8 seconds",
            "line 6: seconds: is 'soon', not a number",
            "line 6: seed: is 'x'",
            "line 7: model:",
        )
        assert ran.out == ""
    lines = [line for line in ran.err.splitlines() if line.startswith("  line")]
    assert lines == sorted(lines)
    table.write_text("prompt,seconds\n\na person hops,3\n\na person walks,12\n")
    marey("submit", "-f", table).refused(2, f"{table}: 1 problem", "line 5: seconds: 12 is outside")


def test_what_a_server_cannot_check_is_said_beside_what_is_wrong(tmp_path: Path) -> None:
    table = tmp_path / "shots.jsonl"
    table.write_text('{"prompt": "a person walks", "seconds": 12}\n{"prompt": ""}\n')
    alone = Command({"MAREY_SERVER": "", "MAREY_HOME": str(tmp_path / "home")})
    alone("submit", "-f", table).refused(2, "line 2: prompt", "Lengths and models were not checked: no server")


def test_the_api_tells_all_problems_of_a_body_at_once(api: LiveApi) -> None:
    body = "\n".join(
        json.dumps(each)
        for each in (
            {"prompt": "a person walks", "seconds": 12},
            {"prompt": "", "seconds": 12, "settings": {"fps": 1000}},
            {"prompt": "a person bows", "seed": "x"},
        )
    )
    with api.http() as http:
        answer = http.post("/v1/jobs", content=body, headers={"Content-Type": "application/x-ndjson"}).json()
    assert [(p["line"], p["field"]) for p in answer["problems"]] == [
        (1, "seconds"), (2, "prompt"), (2, "settings"), (2, "seconds"), (3, "seed"),
    ]  # fmt: skip


def test_names_of_any_script_become_files_in_folders_of_a_template(
    api: LiveApi, marey: Command, tmp_path: Path
) -> None:
    table = tmp_path / "shots.csv"
    table.write_text(
        "prompt,name,shot,seed\n" + "".join(f"a person walks,{name},{n}/{n},7\n" for n, name in enumerate(NAMES))
    )
    job = marey("submit", "-f", table, "--extra-columns", "tag").ok().out.strip()
    api.work()
    folder = tmp_path / "clips"
    marey("fetch", job, "-o", folder).ok()
    found = rows(folder)
    assert [row["name"] for row in found] == [unicodedata.normalize("NFC", name) for name in NAMES]
    assert [row["tags"] for row in found] == [f"shot={n}/{n}" for n in range(5)]
    assert {row["npz"] for row in found} < set(clips(folder))
    assert all(len(f"{path.name}.part".encode()) <= 255 for path in folder.iterdir())
    template = ("--name-template", "{model}/{tag:shot}/{name}_{variant}")
    deep = tmp_path / "deep"
    lines = marey("fetch", job, "-o", deep, "--json", *template).ok().lines
    assert sorted(clips(deep)) == sorted(
        Path(path).relative_to(deep).as_posix() for line in lines for path in line["files"].values()
    )
    assert [row["bvh"] for row in rows(deep)][:3] == [
        "hgm3/0_0/Zoë_0.bvh", "hgm3/1_1/日本 散歩_0.bvh", "hgm3/2_2/Szene 3_ auf__0.bvh",
    ]  # fmt: skip
    before = clips(deep)
    marey("fetch", job, "-o", deep, *template).ok()
    assert clips(deep) == before
    ran = marey("fetch", job, "-o", deep, "--prune").ok()
    assert "10 files of earlier fetches" in ran.err
    assert not (deep / "hgm3").exists()
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "hgm3").symlink_to(tmp_path)
    marey("fetch", job, "-o", tmp_path / "linked", *template).refused(2, "a link that leads out of the folder")


def test_a_fetch_into_a_folder_of_the_release_before_adds_nothing_twice(
    api: LiveApi, marey: Command, tmp_path: Path
) -> None:
    job = marey("submit", "a person walks", "a person bows", "--seed", 3, "--tag", "=1+1").ok().out.strip()
    api.work()
    folder = tmp_path / "clips"
    marey("fetch", job, "-o", folder).ok()
    new = rows(folder)
    assert {row["tags"] for row in new} == {"'=1+1"}
    with (folder / NAME).open("w", newline="", encoding="utf-8") as stream:  # as that release wrote it
        writer = csv.DictWriter(stream, RAW_COLUMNS)
        writer.writeheader()
        writer.writerows({name: restore(row[name]) for name in RAW_COLUMNS} for row in new)
    before = clips(folder)
    assert sorted(before) == [
        f"{n:05}_a-person-{what}_3.{kind}" for n, what in enumerate(("walks", "bows")) for kind in ("bvh", "npz")
    ]
    ran = marey("fetch", job, "-o", folder).ok()
    assert "earlier" not in ran.err
    assert clips(folder) == before
    assert rows(folder) == new


def test_a_manifest_is_submitted_again(api: LiveApi, marey: Command, tmp_path: Path) -> None:
    line = {"prompt": "=a person walks", "name": "Zoë", "tags": ["-x", "a;b"], "seed": 9, "seconds": 2.0}
    job = marey("submit", "-f", "-", stdin=json.dumps(line)).ok().out.strip()
    api.work()
    marey(
        "submit",
        "-f",
        "-",
        "--fetch",
        tmp_path,
        "--name-template",
        "{seed}/{name}",
        "--dry-run",
        stdin=json.dumps(line),
    ).ok()
    marey("fetch", job, "-o", tmp_path).ok()
    again = marey("submit", "-f", tmp_path / NAME).ok().out.strip()
    with api.client() as client:
        (old,), (new,) = (list(client.pages(f"/v1/jobs/{each}/items")) for each in (job, again))
    for field in ("prompt", "name", "tags", "seed", "seconds", "model", "bundle"):
        assert old[field] == new[field], field
    assert new["prompt"] == "=a person walks"


@pytest.mark.parametrize("field", ["name", "comment"])
def test_a_job_with_control_characters_is_refused(api: LiveApi, field: str) -> None:
    with api.http() as http:
        for text in ("a\x1b[2J", "\u202e", "\x9b"):
            body = {"items": [{"prompt": "a person walks"}], field: text}
            answer = http.post("/v1/jobs", json=body)
            assert answer.status_code == 422
            assert answer.json()["problems"][0]["field"] == field
            line = http.post("/v1/jobs", params={field: text}, content=b'{"prompt": "a person walks"}',
                             headers={"Content-Type": "application/x-ndjson"})  # fmt: skip
            assert line.status_code == 422


def test_rows_of_earlier_releases_are_shown_escaped_and_told_as_they_are(
    api: LiveApi, marey: Command, tmp_path: Path
) -> None:
    text = "a\x1b[2Jb\x9b\u202ec\x7f\td\n"
    job = marey("submit", "a person walks").ok().out.strip()
    api.work()
    with transaction(api.engine) as conn:  # the edge takes no such text any more
        conn.execute(sa.update(tables.job).values(name=text, comment=text))
        conn.execute(sa.update(tables.item).values(name=text, prompt=f"walk {text}", tags=[text]))
        conn.execute(
            sa.update(tables.motion).values(
                review="kept", review_comment=text, reviewed_by=text, reviewed_at=sa.func.now()
            )
        )
    for command in (["jobs", "list"], ["jobs", "show", job], ["motions", "list"], ["jobs", "watch", job]):
        ran = marey(*command).ok()
        assert find_forbidden(ran.out + ran.err, "\n\t") is None, command
        if command[1] != "watch":
            (line, *_) = marey(*command, "--json").ok().out.splitlines()
            assert find_forbidden(line) is None
            assert text in json.loads(line).values()
    ran = marey("fetch", job, "-o", tmp_path).ok()
    assert find_forbidden(ran.out + ran.err, "\n\t") is None
    (row,) = rows(tmp_path)
    assert row["npz"].startswith("00000_a_[2Jb__c__d_")
    with api.client() as client:
        (item,) = client.pages(f"/v1/jobs/{job}/items")
        client.post("/v1/motions/reroll", {"motions": [item["motion"]["id"]]})
