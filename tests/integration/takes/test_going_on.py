"""Ctrl-C ends a command that waits, not what it waits for; and that is said."""

from __future__ import annotations

from typing import Any

import pytest

from marey.cli.evaluating import watch_evaluation
from marey.client import Client
from marey.client.transport import Transport
from tests.support.command import Command
from tests.support.live_api import LiveApi


def interrupted(*_: Any, **__: Any) -> Any:
    raise KeyboardInterrupt


@pytest.mark.parametrize("wait", ["--watch", "--fetch"])
def test_an_interrupted_submit_says_that_the_job_goes_on_and_how_to_look_at_it(
    api: LiveApi, marey: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Any, wait: str
) -> None:
    monkeypatch.setattr(Transport, "events", interrupted)
    ran = marey("submit", "a person walks", wait, *([tmp_path] if wait == "--fetch" else []))
    job = ran.out.strip()
    ran.refused(130, f"job {job} goes on", f"marey jobs watch {job}", f"marey jobs cancel {job}", "marey: interrupted")
    with api.client() as client:
        assert client.get(f"/v1/jobs/{job}")["state"] == "queued"


def test_an_interrupted_wait_for_an_evaluation_says_so_too(
    api: LiveApi, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Transport, "get", interrupted)
    with Client(api.url, api.key) as client, pytest.raises(KeyboardInterrupt):
        watch_evaluation(client, "RUN")
    assert "evaluation RUN goes on.\n  `marey eval wait RUN` waits again" in capsys.readouterr().err
