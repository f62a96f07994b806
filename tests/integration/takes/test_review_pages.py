"""`marey review`: the motions of a job as pages and as contact sheets."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
import psutil
import pytest
from PIL import Image

from marey.db import transaction
from marey.takes import delete
from marey.tenants import DEFAULT_TENANT
from marey.viz.overview import GAP, MARGIN, TILE
from tests.support.command import Command
from tests.support.editing import edited, stored
from tests.support.live_api import LiveApi
from tests.support.walker import walker

HOSTILE = "a person walks </script><script>alert(1)</script><!-- %MOTION%"


@pytest.fixture(scope="module")
def job(api: LiveApi) -> str:
    """Five motions, of which the third is made last."""
    with api.client() as client:
        prompts = [{"prompt": HOSTILE if k == 0 else f"a person walks {k}", "seed": k} for k in range(5)]
        job = client.submit([{**prompt, "tags": ["shot=010"]} for prompt in prompts], name="day 1")["id"]
        made = walker(seconds=0.5).to_npz()
        api.work(made, fail=frozenset({"a person walks 2"}))
        client.post(f"/v1/jobs/{job}/retry", {})
        api.work(made)
    return job


def embedded(page: Path, name: str) -> dict[str, object]:
    found = re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', page.read_text())
    assert found is not None
    return json.loads(found[1])


def test_every_motion_is_on_one_of_the_pages_in_input_order(marey: Command, job: str, tmp_path: Path) -> None:
    first, second = marey("motions", "list", "--job", job, "--limit", 2, "--json").ok().lines
    marey("motions", "keep", first["id"], "--comment", "good").ok()
    out = marey("review", job, "-o", tmp_path / "r.html", "--per-page", 2).ok().out.splitlines()
    assert [Path(line).name for line in out] == ["r-1.html", "r-2.html", "r-3.html"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r-1.html", "r-2.html", "r-3.html"]
    pages = [embedded(tmp_path / Path(line).name, "cards") for line in out]
    assert [page["count"] for page in pages] == ["1 to 2 of 5", "3 to 4 of 5", "5 to 5 of 5"]
    assert [(page["earlier"], page["later"]) for page in pages] == [
        (None, "./r-2.html"), ("./r-1.html", "./r-3.html"), ("./r-2.html", None),
    ]  # fmt: skip
    card = pages[0]["cards"][0]
    assert (card["id"], card["prompt"], card["said"]) == (first["id"], HOSTILE, "kept by all: good")
    assert (card["tags"], card["facts"]) == (["shot=010"], "00000 · seed 0 · 2.0 s")
    assert pages[0]["cards"][1]["id"] == second["id"]
    assert [card["facts"][:5] for page in pages for card in page["cards"]] == [f"{k:05}" for k in range(5)]
    assert len(embedded(tmp_path / "r-1.html", "motion")["clips"]) == 2
    assert (tmp_path / "r-1.html").read_text().count("<script>alert(1)") == 0
    marey("review", job, "-o", tmp_path / "kept.html", "--review", "kept").ok()
    assert [card["id"] for card in embedded(tmp_path / "kept.html", "cards")["cards"]] == [first["id"]]
    assert embedded(tmp_path / "kept.html", "cards")["count"] == "1 to 1 of 1"


def test_several_jobs_stand_side_by_side_prompt_by_prompt(
    api: LiveApi, marey: Command, job: str, tmp_path: Path
) -> None:
    with api.client() as client:
        prompts = [{"prompt": f"a person walks {k}", "seed": 9} for k in (3, 1)]
        other = client.submit([*prompts, {"prompt": "a person sits", "seed": 9}])["id"]
        api.work(walker(seconds=0.5).to_npz())
    marey("review", job, other, "-o", tmp_path / "r.html").ok()
    page = embedded(tmp_path / "r.html", "cards")
    shown = [(card["prompt"][-1], card["facts"].split("seed ")[1][0]) for card in page["cards"]]
    assert shown == [("%", "0"), ("1", "1"), ("1", "9"), ("2", "2"), ("3", "3"), ("3", "9"), ("4", "4"), ("s", "9")]
    assert page["columns"] == 2
    marey("review", job, other, "-o", tmp_path / "p.html", "--per-page", 3).ok()
    assert len(embedded(tmp_path / "p-1.html", "cards")["cards"]) == 2


def test_a_contact_sheet_has_a_row_for_each_and_the_rest_is_announced(marey: Command, job: str, tmp_path: Path) -> None:
    ran = marey("review", job, "-o", tmp_path / "r.png", "--limit", 2, "--skip", 1, "--tag", "shot=010").ok()
    assert [Path(line).name for line in ran.out.splitlines()] == ["r.png"]
    assert f"`--skip 3 -o {tmp_path / 'r-from-4.png'}` goes on" in ran.err
    with Image.open(tmp_path / "r.png") as two:
        height = two.height
    marey("review", job, "-o", tmp_path / "r.png", "--limit", 1, "--skip", 4, "--overwrite").ok()
    with Image.open(tmp_path / "r.png") as one:
        assert 300 < height - one.height < 450


def test_existing_pages_stay_and_the_rest_gets_another_name(marey: Command, job: str, tmp_path: Path) -> None:
    command = ("review", job, "--per-page", 1, "--limit", 2)
    assert "r-from-3.html" in marey(*command, "-o", tmp_path / "r.html").ok().err
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    ran = marey(*command, "-o", tmp_path / "r.html", "--skip", 2)
    ran.refused(2, f"{tmp_path / 'r-1.html'}: already exists, and 1 more of 2 pages", "-o", "--overwrite")
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    ran = marey(*command, "-o", tmp_path / "r-from-3.html", "--skip", 2).ok()
    assert "r-from-5.html" in ran.err
    assert {name: embedded(tmp_path / name, "cards")["count"] for name in ("r-1.html", "r-from-3-1.html")} == {
        "r-1.html": "1 to 1 of 2 and more", "r-from-3-1.html": "3 to 3 of 4 and more",
    }  # fmt: skip
    marey(*command, "-o", tmp_path / "r.html", "--skip", 2, "--overwrite").ok()
    assert embedded(tmp_path / "r-1.html", "cards")["count"] == "3 to 3 of 4 and more"


def test_what_cannot_be_drawn_is_said(marey: Command, job: str, tmp_path: Path) -> None:
    marey("review", job, "-o", tmp_path / "r.gif").refused(2, "neither a .png nor a .html")
    marey("review", job, "-o", tmp_path / "r.html", "--tag", "shot=99").refused(3, "no motion of this job fits")
    marey("review", job, "-o", tmp_path / "none" / "r.html").refused(2, "r.html: cannot be written")
    assert list(tmp_path.iterdir()) == []


def test_no_page_is_replaced_when_one_cannot_be_drawn(api: LiveApi, marey: Command, tmp_path: Path) -> None:
    with api.client() as client:
        job = client.submit([{"prompt": f"a person bows {k}", "seed": k} for k in range(3)])["id"]
        api.work(walker(seconds=0.5).to_npz(), fail=frozenset({"a person bows 2"}))
        client.post(f"/v1/jobs/{job}/retry", {})
        api.work(b"no motion")
    before = {tmp_path / f"r-{page}.png": b"old" for page in (1, 2, 3)}
    for path, content in before.items():
        path.write_bytes(content)
    marey("review", job, "-o", tmp_path / "r.png", "--per-page", 1, "--overwrite").refused(2, "npz")
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_many_motions_are_tiles_drawn_by_processes_of_a_console_script(api: LiveApi, tmp_path: Path) -> None:
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks", "seed": 0, "variants": 26}])["id"]
        api.work(walker(seconds=0.5).to_npz())
    script = Path(sys.executable).with_name("marey")
    environment = {**os.environ, "MAREY_SERVER": api.url, "MAREY_KEY": api.key}
    command = [str(script), "review", job, "-o", str(tmp_path / "r.png")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    with Image.open(tmp_path / "r.png") as image:
        assert image.height < 26 * TILE[1] / 2  # beside each other
        sheet = np.asarray(image)
    left, top = MARGIN, MARGIN - 8 + 56
    tiles = [sheet[top:, left + k * (TILE[0] + GAP[0]) :][60 : TILE[1], : TILE[0]] for k in (0, 1)]
    np.testing.assert_array_equal(*tiles)
    assert (tiles[0][..., 2].astype(int) - tiles[0][..., 0] > 60).sum() > 1000  # the left sides of six figures


def test_an_interrupt_ends_the_command_and_all_that_draws(api: LiveApi, tmp_path: Path) -> None:
    """Ctrl-C reaches every process of a terminal: one line is printed, no page changed, no process left."""
    with api.client() as client:
        job = client.submit(3 * [{"prompt": "a person walks", "seed": 0, "variants": 100}])["id"]
        api.work(walker(seconds=0.5).to_npz())
    (tmp_path / "r.png").write_bytes(b"old")
    environment = {**os.environ, "MAREY_SERVER": api.url, "MAREY_KEY": api.key}
    command = [sys.executable, "-m", "marey.cli", "review", job, "-o", str(tmp_path / "r.png"), "--overwrite"]
    running = psutil.Popen(command, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 60
    while len(drawing := [each for each in running.children() if "spawn_main" in " ".join(each.cmdline())]) < 2:
        assert time.monotonic() < deadline, "nothing is drawn"
        assert running.poll() is None, "it has ended"
        time.sleep(0.05)
    os.killpg(running.pid, signal.SIGINT)
    assert running.wait(120) == 130
    *progress, last = running.communicate()[1].splitlines()
    assert last == "marey: interrupted"
    assert all("drawing" in line for line in progress)  # the bar, once a page has a motion
    assert psutil.wait_procs(drawing, timeout=60)[1] == []
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("r.png", b"old")]


def test_a_card_says_what_a_motion_was_edited_from(marey: Command, api: LiveApi, tmp_path: Path) -> None:
    source, other = stored(api, "a person walks to the left"), stored(api, "a person waves")
    (edit,) = edited(api, source["id"], {"op": "trim", "from": 0.5, "to": "f30"}, {"op": "mirror"})
    (joined,) = edited(api, edit["id"], {"op": "concat", "with": other["id"], "blend": 0.1})
    jobs = (joined["job"], other["job"], source["job"], edit["job"])
    marey("review", *jobs, "-o", tmp_path / "all.html").ok()
    cards: Any = embedded(tmp_path / "all.html", "cards")["cards"]
    assert [card["id"] for card in cards] == [other["id"], source["id"], edit["id"], joined["id"]]
    assert [card["edit"] for card in cards[:3]] == [
        None,
        None,
        {
            "source": source["id"],
            "prompt": "a person walks to the left",
            "operations": "trim (from 0.5, to f30), mirror",
        },
    ]
    assert cards[2]["facts"].endswith(f"edit of {source['id'][-8:]}")
    assert cards[3]["edit"]["prompt"] == edit["prompt"]
    assert cards[3]["edit"]["operations"] == f"concat (blend 0.1, with {other['id'][-8:]})"
    marey("review", edit["job"], "-o", tmp_path / "alone.html").ok()
    (alone,) = embedded(tmp_path / "alone.html", "cards")["cards"]
    assert alone["edit"] == cards[2]["edit"]
    with transaction(api.engine) as conn:
        delete(conn, DEFAULT_TENANT, UUID(source["job"]))
    marey("review", edit["job"], "-o", tmp_path / "alone.html", "--overwrite").ok()
    (alone,) = embedded(tmp_path / "alone.html", "cards")["cards"]
    assert alone["edit"] == {**cards[2]["edit"], "prompt": ""}
