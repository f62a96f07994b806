"""Edits of stored motions whose frames a model generates: requests, text stage, results, erasure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest

from marey.core.settings import Settings
from marey.generation.handler import GeneratorHandler
from marey.jobs.types import UNREAD
from marey.registry import get_model, model_names
from marey.takes import collect_garbage, rewrite_files
from tests.integration.takes.test_edits import post
from tests.integration.takes.test_retention import SECRET, dump, objects
from tests.support.command import Command
from tests.support.editing import clip_of, edited, stored, work_edits
from tests.support.live_api import LiveApi, write_bundle
from tests.support.models import load, random_bundle
from tests.support.runtime import Loop
from tests.support.text_stage import read_texts

MODEL = next(name for name in model_names() if get_model(name).keeps_frames)
PROMPT = "a person sits down"


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A model of random weights in place of the bundle that the API knows."""
    return load(random_bundle(MODEL, tmp_path_factory.mktemp("bundle") / "random"))


@pytest.fixture(autouse=True)
def _bundles(api_home: Path) -> None:
    models = api_home / "models"
    if not (models / "streams-only").exists():
        other = next(name for name in model_names() if not get_model(name).keeps_frames)
        write_bundle(models, "streams-only", model=other)


def work(api: LiveApi, generator: Any) -> None:
    loop = Loop(api.engine, api.store, GeneratorHandler(MODEL, lambda *_, **__: generator, 8, Settings()))
    try:
        loop.run()
    finally:
        loop.close()


def generated(api: LiveApi, generator: Any, motion: str, *ops: dict[str, object], **fields: object) -> Any:
    """The job of an edit, worked off."""
    with api.http() as http:
        answer = post(http, motion, *ops, **fields)
        assert answer.status_code == 202, answer.text
        read_texts(api)
        work(api, generator)
        return http.get(f"/v1/jobs/{answer.json()['id']}/items").json()["items"]


def test_frames_are_generated_after_those_of_the_motion(api: LiveApi, http: httpx2.Client, generator: Any) -> None:
    source = stored(api, "a person walks", name="hero")
    op = {"op": "extend", "seconds": 1, "prompt": PROMPT, "seed": 4, "force": True}
    (item,) = generated(api, generator, source["id"], {"op": "trim", "to": 1.0}, op)
    assert item["state"] == "succeeded", item["error"]
    motion = item["motion"]
    assert (item["model"], motion["edited_from"], motion["frames"]) == (MODEL, [source["id"]], 41)
    assert (motion["name"], motion["prompt"]) == ("hero", f"a person walks, then {PROMPT}")
    before, after = clip_of(api, source["id"]), clip_of(api, motion["id"])
    assert np.array_equal(after.joints[:21], before.joints[:21])
    done = after.manifest["edited_from"]["ops"][1]
    assert (done["prompt"], done["seed"]) == (PROMPT, 4)
    assert done["model"]["bundle"] == generator.bundle.reference
    assert after.manifest["prompts"] == [[0, "a person walks"], [21, PROMPT]]
    again = generated(api, generator, source["id"], {"op": "trim", "to": 1.0}, op)[0]["motion"]
    assert clip_of(api, again["id"]).to_npz() == after.to_npz()
    assert http.get(f"/v1/jobs/{item['job']}").json()["kind"] == "edit"


def test_what_the_text_stage_reads(api: LiveApi, http: httpx2.Client, generator: Any) -> None:
    first, second = stored(api, "a person steps to the left"), stored(api, "a person waves")
    way = {"op": "in-between", "with": second["id"], "seconds": 0.5, "force": True}
    assert post(http, first["id"], way).status_code == 202
    assert post(http, first["id"], {"op": "mirror"}, {"op": "extend", "seconds": 1, "force": True}).status_code == 202
    assert sorted(read_texts(api)) == [(UNREAD,), ("a person steps to the right",)]
    work(api, generator)
    with api.client() as client:
        made = {motion["prompt"]: motion for motion in client.pages("/v1/motions") if motion["edited_from"]}
    joined = made["a person steps to the left, then a person waves"]
    assert joined["frames"] == 2 * 41 + 10
    assert joined["edited_from"] == [first["id"], second["id"]]
    assert made["a person steps to the right"]["frames"] == 61


@pytest.mark.parametrize(
    ("ops", "fields", "where", "words"),
    [
        ([{"op": "extend", "seconds": 1}], {"model": "streams-only"}, "model", "cannot generate frames around others"),
        ([{"op": "extend", "seconds": 1}], {"model": "nowhere"}, "model", "nowhere"),
        ([{"op": "mirror"}], {"model": MODEL}, "model", "no model is used"),
        ([{"op": "extend", "seconds": 1}], {"settings": {"mood": 1}}, "settings", "mood"),
        ([{"op": "extend", "seconds": 1}], {"settings": {"best_of": 2}}, "settings", "candidates"),
        ([{"op": "repaint", "to": 1, "prompt": "走"}], {}, "ops.0.prompt", "English"),
        ([{"op": "repaint", "to": 1, "prompt": " "}], {}, "ops.0.prompt", "is not a sentence"),
        ([{"op": "repaint", "to": 1, "seed": -1}], {}, "ops.0.seed", "whole number"),
        ([{"op": "body-part", "part": "tail", "prompt": PROMPT}], {}, "ops.0.part", "upper-body"),
        ([{"op": "repaint", "from": 4, "to": 2.5, "prompt": PROMPT}], {}, "ops.0.to", "2.5 s, is before the beginning"),
        ([{"op": "repaint", "from": "f9", "to": "f8"}], {}, "ops.0.to", "the end, frame 8, is before"),
        (
            [{"op": "repaint", "to": 1, "prompt": PROMPT}, {"op": "extend", "seconds": 1}],
            {},
            "ops.1.prompt",
            "which action goes on",
        ),
    ],
)
def test_an_error_names_its_field(
    api: LiveApi, http: httpx2.Client, ops: list[object], fields: dict[str, Any], where: str, words: str
) -> None:
    answer = post(http, stored(api)["id"], *ops, **fields)
    assert answer.status_code == 422, answer.text
    assert answer.json()["where"] == where
    assert words in answer.text


def test_what_only_the_frames_show_fails_the_item(api: LiveApi, generator: Any) -> None:
    source = stored(api)
    (item,) = generated(api, generator, source["id"], {"op": "repaint", "from": 5, "prompt": PROMPT})
    assert (item["state"], item["error"]["where"]) == ("failed", "ops.0 (repaint)")
    assert "after the end of the motion" in item["error"]["message"]


def test_words_of_operations_are_erased_with_the_prompt(api: LiveApi, http: httpx2.Client, generator: Any) -> None:
    source = stored(api, "a person walks")
    op = {"op": "extend", "seconds": 1, "prompt": f"a person looks for {SECRET}", "force": True}
    (item,) = generated(api, generator, source["id"], op)
    (later,) = edited(api, item["motion"]["id"], {"op": "mirror"})
    assert SECRET in dump(api.engine)
    answer = http.post(f"/v1/jobs/{item['job']}/erase")
    assert answer.status_code == 200, answer.text
    rewrite_files(api.engine, api.store)
    collect_garbage(api.engine, api.store)
    assert SECRET not in dump(api.engine)
    assert not any(SECRET.encode(coding) in data for data in objects(api.store) for coding in ("utf-8", "utf-32-le"))
    kept = http.get(f"/v1/jobs/{item['job']}/items").json()["items"][0]["edits"]["ops"]
    assert kept == [{key: value for key, value in {**op, "seed": 0, "candidates": 1}.items() if key != "prompt"}]
    assert clip_of(api, later["id"]).manifest["erased"] is True
    work_edits(api)


def test_the_command_names_the_bundle_and_the_prompt(marey: Command, api: LiveApi, generator: Any) -> None:
    source = stored(api, "a person walks")
    ran = marey(
        *("motions", "edit", source["id"], "--repaint", "0.5:1", "--prompt", "a person hops", "--seed", 3, "--force"),
        *("--set", "temperature=0.7", "--no-wait"),
    )
    assert ran.code == 0, ran.err
    assert read_texts(api) == [("a person hops",)]
    work(api, generator)
    with api.client() as client:
        (item,) = client.pages(f"/v1/jobs/{ran.out.strip()}/items")
    assert item["settings"] == {"temperature": 0.7}
    assert item["edits"]["ops"][0]["seed"] == 3
    assert item["motion"]["frames"] == clip_of(api, source["id"]).frames
