"""Counted in a process of its own: what is said to malloc holds until the process ends."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

from marey.api import app
from marey.http import process
from marey.runtime import malloc

THREADS = """
import ctypes, os, sys, tempfile, threading
from marey.runtime.malloc import one_heap

if sys.argv[1] == "one":
    one_heap()
together = threading.Barrier(8)

def work():
    together.wait()
    held = [bytes(4096) for _ in range(100)]
    together.wait()

threads = [threading.Thread(target=work) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc = ctypes.CDLL(None)
libc.fdopen.restype = ctypes.c_void_p
with tempfile.TemporaryFile("w+") as told:
    stream = ctypes.c_void_p(libc.fdopen(os.dup(told.fileno()), b"w"))
    libc.malloc_info(0, stream)
    libc.fclose(stream)
    told.seek(0)
    print(told.read().count("<heap nr="))
"""
glibc = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc has heaps of threads")


def heaps(how: str, **environment: str) -> int:
    kept = {name: value for name, value in os.environ.items() if name not in malloc.SAID}
    asked = [sys.executable, "-c", THREADS, how]
    return int(subprocess.run(asked, env={**kept, **environment}, check=True, capture_output=True, text=True).stdout)


@glibc
def test_threads_share_one_heap() -> None:
    assert heaps("as it is") > 1
    assert heaps("one") == 1


@glibc
def test_an_operator_may_say_otherwise() -> None:
    assert heaps("one", MALLOC_ARENA_MAX="3") == 3


def test_another_system_is_left_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(malloc.ctypes, "CDLL", lambda _: pytest.fail("was asked"))
    malloc.one_heap()


def test_the_api_asks_for_it_before_it_starts_anything(monkeypatch: pytest.MonkeyPatch) -> None:
    class ModuleLoaded(Exception):
        pass

    def asked() -> None:
        raise ModuleLoaded

    monkeypatch.setattr(process, "one_heap", asked)
    with pytest.raises(ModuleLoaded):
        app.serve()
