"""Wrong settings as a person meets them: one sentence and exit code 2, before anything is started."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from tests.support.marey import Marey


@pytest.mark.parametrize(
    ("variable", "value", "command"),
    [
        ("MAREY_REWRITER", "silly", ("generate", "a person waves")),
        ("MAREY_DATABASE_URL", "foo", ("serve",)),
        ("MAREY_LOG_LEVEL", "silly", ("serve",)),
        ("MAREY_WEBHOOK_KEY", "silly", ("serve", "--port", 0)),
        ("MAREY_PORT", "abc", ("api",)),
    ],
    ids=lambda given: given if isinstance(given, str) else given[0],
)
def test_a_wrong_setting_ends_a_command_at_once(
    offline: Marey, variable: str, value: str, command: tuple[object, ...]
) -> None:
    replace(offline, environment={variable: value})(*command).refused(2, f"{variable}: ")
    assert not (offline.home / "logs").exists()


def test_doctor_tells_a_wrong_setting_among_the_rest(offline: Marey) -> None:
    checks = replace(offline, environment={"MAREY_PORT": "abc"})("doctor", "--json").lines
    told = {check["name"]: check for check in checks}
    assert told["settings"]["state"] == "bad"
    assert "MAREY_PORT: 'abc'" in told["settings"]["message"]
    assert told["home"]["state"] != "bad"


@pytest.mark.parametrize("port", [99999, -1])
def test_a_port_that_is_none_is_wrong_usage(offline: Marey, port: int) -> None:
    offline("serve", "--port", port).refused(2, "--port", "65535" if port > 0 else "0")


def test_an_address_that_is_none_is_told(offline: Marey) -> None:
    for host in ("a..b", "nowhere.invalid"):
        offline("serve", "--port", 0, "--host", host).refused(2, host, "cannot be used")


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_device_that_is_not_there_is_told_before_anything_starts(offline: Marey) -> None:
    wanting = replace(offline, environment={"MAREY_DEVICE": "cuda"})
    wanting("serve", "--port", 0).refused(2, "MAREY_DEVICE", "no CUDA device", "cpu or auto")
    assert not (offline.home / "logs").exists()
    wanting("generate", "a person waves").refused(2, "no CUDA device", "MAREY_DEVICE")
