"""`marey review`: the motions of a job as pages and as contact sheets."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from PIL import Image

from tests.support.command import Command
from tests.support.live_api import LiveApi
from tests.support.walker import walker

HOSTILE = "a person walks </script><script>alert(1)</script><!-- %MOTION%"


@pytest.fixture(scope="module")
def job(api: LiveApi) -> str:
    """Five motions."""
    with api.client() as client:
        prompts = [{"prompt": HOSTILE if k == 0 else f"a person walks {k}", "seed": k} for k in range(5)]
        job = client.submit([{**prompt, "tags": ["shot=010"]} for prompt in prompts], name="day 1")["id"]
        api.work(walker(seconds=0.5).to_npz())
    return job


def embedded(page: Path, name: str) -> dict[str, object]:
    found = re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', page.read_text())
    assert found is not None
    return json.loads(found[1])


def test_every_motion_is_on_one_of_the_pages_with_what_was_said(marey: Command, job: str, tmp_path: Path) -> None:
    first, second = marey("motions", "list", "--job", job, "--limit", 2, "--json").ok().lines
    marey("motions", "keep", first["id"], "--comment", "good").ok()
    out = marey("review", job, "-o", tmp_path / "r.html", "--per-page", 2).ok().out.splitlines()
    assert [Path(line).name for line in out] == ["r.html", "r-2.html", "r-3.html"]
    pages = [embedded(tmp_path / Path(line).name, "cards") for line in out]
    assert [page["count"] for page in pages] == ["1 to 2 of 5", "3 to 4 of 5", "5 to 5 of 5"]
    assert [(page["earlier"], page["later"]) for page in pages] == [
        (None, "./r-2.html"), ("./r.html", "./r-3.html"), ("./r-2.html", None),
    ]  # fmt: skip
    card = pages[0]["cards"][0]
    assert (card["id"], card["prompt"], card["said"]) == (first["id"], HOSTILE, "kept by all: good")
    assert (card["tags"], card["facts"]) == (["shot=010"], "00000 · seed 0 · 2.0 s")
    assert pages[0]["cards"][1]["id"] == second["id"]
    assert len(embedded(tmp_path / "r.html", "motion")["clips"]) == 2
    assert (tmp_path / "r.html").read_text().count("<script>alert(1)") == 0


def test_a_contact_sheet_has_a_row_for_each_and_the_rest_is_announced(marey: Command, job: str, tmp_path: Path) -> None:
    ran = marey("review", job, "-o", tmp_path / "r.png", "--limit", 2, "--skip", 1, "--tag", "shot=010").ok()
    assert [Path(line).name for line in ran.out.splitlines()] == ["r.png"]
    assert f"`--skip 3 -o {tmp_path / 'r-from-4.png'}` goes on" in ran.err
    with Image.open(tmp_path / "r.png") as two:
        height = two.height
    marey("review", job, "-o", tmp_path / "r.png", "--limit", 1, "--skip", 4, "--overwrite").ok()
    with Image.open(tmp_path / "r.png") as one:
        assert 300 < height - one.height < 450


def test_pages_that_are_there_stay_and_what_goes_on_is_named_otherwise(
    marey: Command, job: str, tmp_path: Path
) -> None:
    told = ("review", job, "--per-page", 1, "--limit", 2)
    assert "r-from-3.html" in marey(*told, "-o", tmp_path / "r.html").ok().err
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    ran = marey(*told, "-o", tmp_path / "r.html", "--skip", 2)
    ran.refused(2, f"{tmp_path / 'r.html'}: is there already, and 1 more of 2 pages", "-o", "--overwrite")
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    ran = marey(*told, "-o", tmp_path / "r-from-3.html", "--skip", 2).ok()
    assert "r-from-5.html" in ran.err
    assert {name: embedded(tmp_path / name, "cards")["count"] for name in ("r.html", "r-from-3.html")} == {
        "r.html": "1 to 1 of 2 and more", "r-from-3.html": "3 to 3 of 4 and more",
    }  # fmt: skip
    marey(*told, "-o", tmp_path / "r.html", "--skip", 2, "--overwrite").ok()
    assert embedded(tmp_path / "r.html", "cards")["count"] == "3 to 3 of 4 and more"


def test_what_cannot_be_drawn_is_said(marey: Command, job: str, tmp_path: Path) -> None:
    marey("review", job, "-o", tmp_path / "r.gif").refused(2, "neither a .png nor a .html")
    marey("review", job, "-o", tmp_path / "r.html", "--tag", "shot=99").refused(3, "no motion of this job fits")
    assert list(tmp_path.iterdir()) == []
