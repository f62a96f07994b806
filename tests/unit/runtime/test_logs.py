import json
import logging
import threading
from collections.abc import Iterator

import pytest
import structlog

from marey.core.characters import LINES, find_forbidden
from marey.runtime.logs import configure_logging, logger


@pytest.fixture(autouse=True)
def _restore_logging() -> Iterator[None]:
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    root.handlers[:] = handlers
    root.setLevel(level)
    structlog.reset_defaults()


def lines(capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    return [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def test_a_line_is_json_with_its_service_from_every_thread(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging("worker-hgm3", json=True)
    log = logger("test")
    log.info("claimed", items=32)
    thread = threading.Thread(target=log.warning, args=("late",))
    thread.start()
    thread.join()
    logging.getLogger("celery").warning("from the standard library")
    written = lines(capsys)
    assert [line["event"] for line in written] == ["claimed", "late", "from the standard library"]
    assert {line["service"] for line in written} == {"worker-hgm3"}
    assert written[0]["items"] == 32


@pytest.mark.parametrize("json_lines", [True, False])
def test_a_traceback_shows_neither_local_variables_nor_rows(
    capsys: pytest.CaptureFixture[str], json_lines: bool
) -> None:
    configure_logging("worker", json=json_lines)

    def fail(prompt: str) -> None:
        raise ValueError(f"constraint violated\nDETAIL: failing row contains ({prompt})")

    try:
        try:
            fail("a secret " + "scene")
        except ValueError as error:
            raise RuntimeError("outer") from error
    except RuntimeError:
        logger("test").exception("failed")
        logging.getLogger("test").exception("failed")
    written = capsys.readouterr().err
    assert "ValueError: constraint violated" in written
    assert "in fail" in written
    assert "RuntimeError: outer" in written
    assert "secret scene" not in written


def test_prompts_and_secrets_are_withheld_whoever_logs_them(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging("api", json=True)
    logger("test").info("submitted", prompt="a secret scene", password="hunter2", url="redis://:pw@host")
    (line,) = lines(capsys)
    assert not {"a secret scene", "hunter2", "redis://:pw@host"} & set(map(str, line.values()))


@pytest.mark.parametrize("json_lines", [True, False])
def test_no_line_makes_a_terminal_do_anything(capsys: pytest.CaptureFixture[str], json_lines: bool) -> None:
    configure_logging("worker-hgm3", json=json_lines)
    attack = "a\x1b[2J\x9b31m\x7f\u202e\ud800\nfaked line"
    log = logger("test")
    log.info("claimed", name=attack, several=[attack])
    logging.getLogger("celery").warning(attack)
    try:
        raise ValueError(attack)
    except ValueError:
        log.exception("failed")
    written = capsys.readouterr().err
    assert find_forbidden(written, LINES) is None
    assert not any(line.startswith("faked") for line in written.splitlines())
    if json_lines:
        assert json.loads(written.splitlines()[0])["name"] == attack
