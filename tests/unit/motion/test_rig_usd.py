"""Rigs of USD files without `usd-core`, and what becomes of a child process that fails; the rest is tests/clients."""

from __future__ import annotations

import signal
import subprocess
import sys
import types

import pytest

from marey.core.errors import InvalidFile, TooLarge
from marey.core.extras import MissingExtra
from marey.motion.io import rig_usd
from marey.motion.rigs.read import parse_rig
from tests.support.usd import usda

DATA = usda().encode()


@pytest.mark.parametrize("name", ["hero.usd", "HERO.USDA", "hero.usdc"])
def test_a_usd_rig_needs_its_extra(name, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(MissingExtra, match="'usd'"):
        parse_rig(DATA, name)


@pytest.mark.parametrize(
    ("code", "kind", "message"),
    [
        (-signal.SIGXCPU, TooLarge, "takes more than 10 s to read"),
        (-signal.SIGABRT, InvalidFile, "broken, or takes too much memory"),
        (-signal.SIGSEGV, InvalidFile, "broken, or takes too much memory"),
        (1, RuntimeError, "failed on hero.usd: oh"),
    ],
)
def test_a_child_that_fails(code, kind, message, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", types.ModuleType("pxr"))
    monkeypatch.setattr(rig_usd.subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], code, b"", b"oh"))
    with pytest.raises(kind, match=message):
        parse_rig(DATA, "hero.usd")


def test_a_child_that_hangs(monkeypatch):
    def hang(command, **options):
        raise subprocess.TimeoutExpired(command, options["timeout"])

    monkeypatch.setitem(sys.modules, "pxr", types.ModuleType("pxr"))
    monkeypatch.setattr(rig_usd.subprocess, "run", hang)
    with pytest.raises(TooLarge, match="takes more than 10 s"):
        parse_rig(DATA, "hero.usd")


def test_a_child_gets_no_settings(monkeypatch):
    seen = {}

    def run(command, **options):
        seen.update(options["env"])
        return subprocess.CompletedProcess(command, 0, b'{"error": "no", "kind": "file", "hint": null}', b"")

    monkeypatch.setitem(sys.modules, "pxr", types.ModuleType("pxr"))
    monkeypatch.setattr(rig_usd.subprocess, "run", run)
    monkeypatch.setenv("MAREY_MASTER_KEY", "secret")
    monkeypatch.setenv("PXR_PLUGINPATH_NAME", "/plugins")
    with pytest.raises(InvalidFile, match="no"):
        parse_rig(DATA, "hero.usd")
    assert seen
    assert not [name for name in seen if name.startswith(("MAREY_", "PXR_"))]
