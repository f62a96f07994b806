"""Imports of what an extra installs."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from marey.core.extras import MissingExtra, extra


def test_ctrl_c_acts_when_the_imports_have_ended() -> None:
    ended: list[bool] = []

    def imports() -> None:
        with extra("motion"):
            os.kill(os.getpid(), signal.SIGINT)
            ended.append(True)

    with pytest.raises(KeyboardInterrupt):
        imports()
    assert ended == [True]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_comes_before_what_is_missing() -> None:
    def imports() -> None:
        with extra("motion"):
            os.kill(os.getpid(), signal.SIGINT)
            raise ImportError

    with pytest.raises(KeyboardInterrupt):
        imports()
    with pytest.raises(MissingExtra, match="'motion'"), extra("motion"):
        raise ImportError(name="numpy")


def test_a_thread_and_a_handler_of_others_are_left_alone() -> None:
    found: list[object] = []

    def imports() -> None:
        with extra("motion"):
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=imports)
    thread.start()
    thread.join()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        imports()
    finally:
        signal.signal(signal.SIGINT, before)
    assert found == [signal.default_int_handler, signal.SIG_IGN]
