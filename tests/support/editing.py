"""Stored motions to edit, and a worker of the queue `edit` in the test's process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from marey.editing.handler import EditHandler
from marey.motion.clip import MotionClip, parse_npz
from tests.support.live_api import LiveApi
from tests.support.repeating import repeating
from tests.support.runtime import Loop
from tests.support.walker import walker


def stored(api: LiveApi, prompt: str = "a person walks", *, clip: MotionClip | None = None, **item: object) -> Any:
    """A stored motion with this prompt, as the API shows it."""
    with api.client() as client:
        job = client.submit([{"prompt": prompt, **item}])
        api.work((clip or walker(prompt=prompt)).to_npz())
        (found,) = client.pages(f"/v1/jobs/{job['id']}/motions")
    return found


def work_edits(api: LiveApi) -> None:
    """Work off what is in the queue `edit`."""
    loop = Loop(api.engine, api.store, EditHandler())
    try:
        loop.run()
    finally:
        loop.close()


@contextmanager
def working_editor(api: LiveApi) -> Iterator[None]:
    """Work off the queue `edit` until the end of the block."""
    loop = Loop(api.engine, api.store, EditHandler())
    try:
        with repeating(loop.run):
            yield
    finally:
        loop.close()


def edited(api: LiveApi, motion: str, *ops: dict[str, object]) -> list[Any]:
    """The motions that operations make of a motion, as the API shows them."""
    with api.client() as client:
        job = client.post(f"/v1/motions/{motion}/edits", {"ops": [*ops]})
        work_edits(api)
        return list(client.pages(f"/v1/jobs/{job['id']}/motions"))


def clip_of(api: LiveApi, motion: str) -> MotionClip:
    """The clip in the npz of a motion."""
    with api.http() as http:
        answer = http.get(f"/v1/motions/{motion}/files/npz", follow_redirects=True)
    assert answer.status_code == 200, answer.text
    return parse_npz(answer.content)
