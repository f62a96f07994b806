"""Wrong settings as a person meets them: one sentence and exit code 2, before anything is started."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
import torch

from tests.support.marey import REPOSITORY, Marey


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
    offline("serve", "--port", port).refused(2, "--port", "65,535" if port > 0 else "0")


def test_an_address_that_is_none_is_told(offline: Marey) -> None:
    for host in ("a..b", "nowhere.invalid"):
        offline("serve", "--port", 0, "--host", host).refused(2, host, "cannot be used")


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_device_that_is_not_there_is_told_before_anything_starts(offline: Marey) -> None:
    wanting = replace(offline, environment={"MAREY_DEVICE": "cuda"})
    wanting("serve", "--port", 0).refused(2, "MAREY_DEVICE", "no CUDA device", "cpu or auto")
    assert not (offline.home / "logs").exists()
    wanting("generate", "a person waves").refused(2, "no CUDA device", "MAREY_DEVICE")


def test_doctor_says_what_to_do_with_a_home_that_cannot_be_written(offline: Marey, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    checks = replace(offline, environment={"MAREY_HOME": str(tmp_path / "file" / "home")})("doctor", "--json").lines
    (home,) = (check for check in checks if check["name"] == "home")
    assert home["state"] == "bad"
    assert "MAREY_HOME" in home["hint"]
    assert "-o" not in home["hint"].split()


def test_an_interrupted_demo_ends_like_any_command(tmp_path: Path) -> None:
    demo = _demo(tmp_path)
    demo.send_signal(signal.SIGINT)
    said = demo.communicate(timeout=120)[1].decode()
    # Python ends itself by the signal where that comes while a text is compiled; a shell says 130 of both.
    assert demo.returncode in (130, -signal.SIGINT), said
    assert "make demo: interrupted" in said
    assert "Traceback" not in said
    _wait_for_servers(tmp_path, 0)


@pytest.mark.skipif(shutil.which("setpriv") is None, reason="processes outlive their parent without setpriv")
def test_no_server_outlives_a_killed_demo(tmp_path: Path) -> None:
    demo = _demo(tmp_path)
    _wait_for_servers(tmp_path, 1)
    demo.kill()
    demo.communicate(timeout=60)
    _wait_for_servers(tmp_path, 0)


def _demo(folder: Path) -> subprocess.Popen[bytes]:
    """A demo that has begun to start its server."""
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    command = [sys.executable, "-m", "marey.cli.demo"]
    demo = subprocess.Popen(command, cwd=folder, env=environment, stderr=subprocess.PIPE)
    log = folder / "out" / "demo" / ".home" / "serve.log"
    while not log.exists():
        assert demo.poll() is None
        time.sleep(0.1)
    return demo


def _wait_for_servers(folder: Path, number: int) -> None:
    deadline = time.monotonic() + 60
    while len(running := [process for process in psutil.process_iter() if _serves(process, folder)]) != number:
        assert time.monotonic() < deadline, running
        time.sleep(0.2)


def _serves(process: psutil.Process, folder: Path) -> bool:
    try:
        return "serve" in process.cmdline() and process.cwd() == str(folder)
    except psutil.Error:
        return False
