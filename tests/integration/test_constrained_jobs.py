"""Items with constraints, timelines and both through a server: request, text stage, model, results, pages."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest

from marey.client import Client
from marey.core.settings import Settings
from marey.generation.handler import GeneratorHandler
from marey.registry import get_model, model_names
from marey.vocabulary.scope import ActionLists
from tests.support.command import Command
from tests.support.editing import clip_of, edited
from tests.support.live_api import LiveApi, write_bundle
from tests.support.models import load, random_bundle
from tests.support.runtime import Loop
from tests.support.text_stage import read_texts

MODEL = next(name for name in model_names() if get_model(name).keeps_frames)
PATH = {"type": "root_path", "times": [0.0, 1.0, 2.0], "positions_xz": [[0.0, 0.0], [0.2, 0.8], [0.4, 1.6]]}
TIMELINE = "0-1.5 a person walks; 1.5-3 a person bows"


@pytest.fixture(scope="module")
def api_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("api")
    write_bundle(home / "models", model=MODEL, actions=ActionLists(supported=("walk", "bow")))
    return home


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A model of random weights in place of the bundle that the API knows."""
    return load(random_bundle(MODEL, tmp_path_factory.mktemp("bundle") / "random"))


@pytest.fixture
def loop(api: LiveApi, generator: Any) -> Iterator[Loop]:
    loop = Loop(api.engine, api.store, GeneratorHandler(MODEL, lambda *_, **__: generator, 8, Settings()))
    yield loop
    loop.close()


@pytest.fixture
def marey(api: LiveApi) -> Command:
    return Command({"MAREY_SERVER": api.url, "MAREY_KEY": api.key})


def made(api: LiveApi, loop: Loop, *items: dict[str, object], name: str | None = None) -> list[dict[str, Any]]:
    """The items of a job, worked off."""
    with api.http() as http:
        answer = http.post("/v1/jobs", json={"items": list(items), "name": name})
        assert answer.status_code == 202, answer.text
        read_texts(api)
        loop.run()
        return http.get(f"/v1/jobs/{answer.json()['id']}/items").json()["items"]


def test_a_motion_keeps_to_its_path(api: LiveApi, loop: Loop) -> None:
    (item,) = made(api, loop, {"prompt": "a person walks", "seed": 3, "seconds": 3, "constraints": [PATH]})
    assert item["state"] == "succeeded", item["error"]
    assert item["constraints"] == [PATH]
    clip = clip_of(api, item["motion"]["id"])
    assert clip.manifest["constraints"] == [PATH]
    (error,) = item["motion"]["quality"]["constraints"]
    assert error["max_m"] <= 0.25
    for time, (x, z) in zip(PATH["times"], PATH["positions_xz"], strict=True):
        assert clip.root[round(time * 20), [0, 2]] == pytest.approx([x, z], abs=0.25)
    with Client(api.url, api.key) as client:
        (motion,) = client.motions.list(job=item["job"])
        assert motion.quality is not None
        assert motion.quality.constraints is not None
        (shown,) = motion.quality.constraints
        assert (shown.type, shown.mean_m, shown.max_m, shown.missed) == (
            *(error[name] for name in ("type", "mean_m", "max_m", "missed")),
        )


def test_a_timeline_keeps_to_its_path(api: LiveApi, loop: Loop) -> None:
    both, alone = made(
        api, loop, {"timeline": TIMELINE, "seed": 3, "constraints": [PATH]}, {"timeline": TIMELINE, "seed": 3}
    )
    assert (both["state"], alone["state"]) == ("succeeded", "succeeded"), (both["error"], alone["error"])
    clip = clip_of(api, both["motion"]["id"])
    assert clip.frames == 60
    assert [row["prompt"] for row in clip.manifest["timeline"]["rows"]] == ["a person walks", "a person bows"]
    assert clip.manifest["prompts"] == [[0, "a person walks"], [30, "a person bows"]]
    assert both["motion"]["quality"]["constraints"][0]["max_m"] <= 0.25
    assert alone["motion"]["quality"]["constraints"] is None


def test_a_fetched_manifest_is_submitted_again_with_its_constraints(
    api: LiveApi, marey: Command, loop: Loop, tmp_path: Path
) -> None:
    rows = [{"timeline": TIMELINE, "constraints": [PATH]}, {"prompt": "a person walks", "constraints": [PATH]}]
    first = made(api, loop, *({**row, "seed": 3} for row in rows), {"prompt": "a person bows"}, name="day 1")
    marey("fetch", "day 1", "-o", tmp_path / "clips").ok()
    again_job = marey("submit", "-f", tmp_path / "clips" / "manifest.csv").ok().out.strip()
    with Client(api.url, api.key) as client:
        again = [each.raw for each in client.jobs.items(again_job)]
    told = ("prompt", "timeline", "constraints", "seed")
    assert [[item[name] for name in told] for item in again] == [[item[name] for name in told] for item in first]
    bad = tmp_path / "bad.csv"
    bad.write_text("prompt,constraints\na person walks,path.json\n")
    refused = marey("submit", "-f", bad)
    assert refused.code == 2
    assert "line 2: constraints: is not a list of constraints" in refused.err


def test_an_item_that_cannot_be_made_names_the_field(
    api: LiveApi, marey: Command, loop: Loop, http: httpx2.Client
) -> None:
    low = {"type": "effector_target", "joint": "pelvis", "frames": [20], "positions": [[0.0, 0.5, 0.0]]}
    stand = {"type": "pose_keyframe", "frame": 20, "joint_rotations": [[1.0, 0.0, 0.0, 0.0]] * 22}
    asked = {"timeline": TIMELINE, "constraints": [stand, low]}
    bad, good = made(api, loop, asked, {"timeline": TIMELINE}, name="late")
    assert (bad["state"], good["state"]) == ("failed", "succeeded")
    assert bad["error"]["where"] == "constraints.1.positions.0"
    shown = marey("jobs", "show", "late").ok().out
    assert f":0.0 {TIMELINE!r}: constraints.1.positions.0: is " in shown
    watched = marey("jobs", "watch", "late")
    assert watched.code == 6


LATE = {**PATH, "times": [0.0, 1.0, 3.2]}
BY_FRAMES = {"type": "root_path", "frames": [0, 15, 30], "positions_xz": PATH["positions_xz"]}
FAR = {**PATH, "times": [0.0, 1.0, 20.0]}


@pytest.mark.parametrize(
    ("item", "field", "message"),
    [
        ({"timeline": TIMELINE, "constraints": [LATE]}, "constraints.0.times.2", "3.2 s is beyond the clip"),
        ({"prompt": "walk", "seconds": 3, "constraints": [LATE]}, "constraints.0.times.2", "3.2 s is beyond the clip"),
        ({"prompt": "walk for 3 seconds", "constraints": [LATE]}, "constraints.0.times.2", "3.2 s is beyond the clip"),
        (
            {"prompt": "walk", "seconds": 3, "settings": {"fps": 10}, "constraints": [BY_FRAMES]},
            "constraints.0.frames.2",
            "frame 30 is beyond the clip, which has 30 frames at 10 fps",
        ),
        ({"prompt": "walk", "constraints": [FAR]}, "constraints", "they take 20.05 s; this bundle generates 9.8 s"),
        ({"prompt": "walk", "constraints": []}, "constraints", "is an empty list"),
    ],
    ids=["timeline", "seconds", "stated", "another rate", "longer than the model", "empty"],
)
def test_constraints_beyond_a_known_length_are_refused_before_the_queue(
    api: LiveApi, marey: Command, http: httpx2.Client, tmp_path: Path, item: dict[str, Any], field: str, message: str
) -> None:
    for validate_only in ("true", "false"):
        answer = http.post("/v1/jobs", json={"items": [item]}, params={"validate_only": validate_only})
        assert answer.status_code == 422, answer.text
        ((found, said),) = [(each["field"], each["message"]) for each in answer.json()["problems"]]
        assert found == field
        assert message in said
    rows = tmp_path / "rows.jsonl"
    rows.write_text(json.dumps(item) + "\n")
    ran = marey("submit", "-f", rows, "--dry-run")
    assert ran.code == 2
    assert f"line 1: {field}: {message}" in ran.err


def test_constraints_up_to_the_last_frame_are_accepted(api: LiveApi, marey: Command, tmp_path: Path) -> None:
    file = tmp_path / "path.json"
    for seconds, end in ((3, 3.0), (3, 2.95)):
        file.write_text(json.dumps([{**PATH, "times": [0.0, 1.0, end]}]))
        marey("submit", "walk", "--seconds", seconds, "--constraints", file, "--dry-run").ok()
    file.write_text(json.dumps([LATE]))
    marey("submit", "walk", "--constraints", file, "--dry-run").ok()
    refused = marey("submit", "walk", "--seconds", 3, "--constraints", file, "--dry-run")
    assert (refused.code, "constraints.0.times.2: 3.2 s is beyond the clip" in refused.err) == (2, True)
    file.write_text("[]")
    refused = marey("submit", "walk", "--constraints", file, "--dry-run")
    assert (refused.code, "constraints: is an empty list" in refused.err) == (2, True)


def test_a_motion_has_the_terms_of_its_poses(api: LiveApi, loop: Loop, generator: Any) -> None:
    turns = [[1.0, 0.0, 0.0, 0.0]] * len(generator.layout.skeleton)
    pose = {"type": "pose_keyframe", "frame": 20, "joint_rotations": turns, "licence": "CC-BY-NC-4.0"}
    own, plain = made(
        api, loop, {"prompt": "walk", "seconds": 3, "constraints": [pose]}, {"prompt": "walk", "seconds": 3}
    )
    assert own["motion"]["licence"] == clip_of(api, own["motion"]["id"]).manifest["licence"] == "CC-BY-NC-4.0"
    assert plain["motion"]["licence"] == generator.bundle.manifest.licence


def test_a_cut_timeline_has_the_prompts_that_are_left(api: LiveApi, loop: Loop, http: httpx2.Client) -> None:
    (item,) = made(api, loop, {"timeline": "0-1.5 a person walks; 1.5-3 a person bows; 3-4.5 a person sits", "seed": 3})
    motion = item["motion"]["id"]
    cuts: tuple[tuple[dict[str, object], str], ...] = (
        ({"op": "trim", "to": "f29"}, "a person walks"),
        ({"op": "trim", "from": 0.5, "to": "f59"}, "0-1 a person walks; 1-2.5 a person bows"),
    )
    for op, wanted in cuts:
        answer = http.post(f"/v1/motions/{motion}/edits", json={"ops": [op]}, params={"validate_only": "true"})
        assert answer.json()["prompts"] == [wanted]
        (found,) = edited(api, motion, op)
        assert found["prompt"] == clip_of(api, found["id"]).manifest["prompt"] == wanted
    (twice,) = edited(api, motion, {"op": "trim", "from": 0.5}, {"op": "trim", "from": 1, "to": "f49"})
    (again,) = edited(api, twice["id"], {"op": "trim", "to": "f29"})
    assert again["prompt"] == "a person bows"


def test_prompts_of_edits_are_examined(api: LiveApi, marey: Command, loop: Loop, http: httpx2.Client) -> None:
    (item,) = made(api, loop, {"prompt": "a person walks", "seconds": 3, "seed": 4})
    motion, option = item["motion"]["id"], ("--extend", 1, "--prompt", "asdf qwer", "--force")
    ops = [{"op": "extend", "seconds": 1, "prompt": "asdf qwer", "force": True}]
    for validate_only in ("true", "false"):
        asked = {"validate_only": validate_only}
        answer = http.post(f"/v1/motions/{motion}/edits", json={"ops": ops}, params=asked).json()
        assert answer["scope_report"]["unknown"] == 1
        assert "'asdf qwer': no action that the model knows" in answer["warnings"][0]
        refused = http.post(f"/v1/motions/{motion}/edits", json={"ops": ops, "scope": "refuse"}, params=asked)
        assert (refused.status_code, "names an action that the model does not know" in refused.text) == (422, True)
        silent = http.post(f"/v1/motions/{motion}/edits", json={"ops": ops, "scope": "ignore"}, params=asked).json()
        assert (silent["scope_report"], silent["warnings"]) == (None, [])
    own = http.post(f"/v1/motions/{motion}/edits", json={"ops": [{"op": "mirror"}]}).json()
    assert (own["scope_report"], own["warnings"]) == (None, [])
    for more in (("--dry-run",), ("--no-wait",)):
        assert "no action that the model knows" in marey("motions", "edit", motion, *option, *more).ok().err
        ran = marey("motions", "edit", motion, *option, *more, "--scope", "refuse")
        assert (ran.code, "names an action that the model does not know" in ran.err) == (2, True)
    with Client(api.url, api.key) as client:
        assert client.check_edit(motion, ops).warnings == client.edit(motion, ops).warnings != ()
        assert client.edit(motion, ops, scope="ignore").warnings == ()


def test_pages_of_timelines_and_of_edits_by_a_model(
    api: LiveApi, marey: Command, loop: Loop, http: httpx2.Client, tmp_path: Path
) -> None:
    (item,) = made(api, loop, {"timeline": TIMELINE, "seed": 3, "name": "hero"}, name="shots")
    page = tmp_path / "shots.html"
    marey("review", "shots", "-o", page).ok()
    assert json.dumps(TIMELINE) in page.read_text()
    bare = [{"op": "trim", "to": 1}, {"op": "extend", "seconds": 1}]
    refused = http.post(f"/v1/motions/{item['motion']['id']}/edits", json={"ops": bare})
    assert (refused.status_code, refused.json()["where"]) == (422, "ops.1.prompt")  # its last prompt may be cut off
    op = {"op": "extend", "seconds": 1, "prompt": "a person sits down", "force": True}
    answer = http.post(f"/v1/motions/{item['motion']['id']}/edits", json={"ops": [op], "name": "longer"})
    assert answer.status_code == 202, answer.text
    read_texts(api)
    loop.run()
    shown = marey("jobs", "show", "longer").ok().out
    assert "kind       edit" in shown
    assert "items      1: 1 succeeded" in shown
    marey("review", "longer", "-o", tmp_path / "longer.html").ok()
    assert f"{TIMELINE}, then a person sits down" in (tmp_path / "longer.html").read_text()
