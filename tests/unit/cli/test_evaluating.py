"""`marey eval` without a server."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from marey.cli.commands import schedules
from marey.cli.evaluating import EvaluationArguments, check_evaluation, repeats_of
from marey.client import EvaluationDetail
from marey.client.evaluation_requests import request_body
from marey.core.errors import InvalidInput, ItemsFailed, NotFound, Regressed


def asked(**changes: Any) -> EvaluationArguments:
    values: dict[str, Any] = dict.fromkeys(("evaluator", "settings", "repeats", "seed", "baseline"))
    return EvaluationArguments(**{**values, "bundle": "hgm3", "split": "test", **changes})


def body(**changes: Any) -> dict[str, Any]:
    """The request that the options of a command lead to."""
    wanted = asked(**changes)
    return request_body(wanted.bundle, wanted.options()).body


def ended(**changes: Any) -> EvaluationDetail:
    return EvaluationDetail.of({"id": "x", "state": "done", "reason": "FID fell", "regressed": None, **changes})


def test_only_what_was_given_is_asked_for() -> None:
    assert body() == {"bundle": "hgm3", "split": "test"}
    assert body(settings=["guidance=4.5", "steps = 10"], repeats=3, seed=0) == {
        "bundle": "hgm3", "split": "test", "settings": {"guidance": 4.5, "steps": 10.0}, "repeats": 3, "seed": 0,
    }  # fmt: skip


def test_both_splits_of_the_evaluator_can_be_asked_for() -> None:
    assert body(split="test+compositional") == {"bundle": "hgm3", "split": "test+compositional"}


def test_to_regenerate_is_to_make_a_motion_for_each_repeat() -> None:
    assert [repeats_of(given, regenerate=anew) for given, anew in ((None, False), (3, False), (None, True))] == [
        None, 3, 20,
    ]  # fmt: skip
    with pytest.raises(InvalidInput, match="means --repeats 20"):
        repeats_of(3, regenerate=True)


def test_prompts_of_a_file_go_with_its_name(tmp_path: Path) -> None:
    (tmp_path / "studio.csv").write_text("prompt,expected\na person walks,walk\na person bows,\n")
    assert body(split=str(tmp_path / "studio.csv")) == {
        "bundle": "hgm3",
        "prompts": [{"prompt": "a person walks", "expected": "walk"}, {"prompt": "a person bows"}],
        "source": "studio.csv",
    }


def test_a_split_that_is_none_is_told_with_those_there_are() -> None:
    with pytest.raises(NotFound, match="neither a split") as told:
        body(split="validation")
    assert "test, compositional, test+compositional" in (told.value.hint or "")


@pytest.mark.parametrize("text", ["guidance", "guidance=", "=3x", "Guidance=3"])
def test_a_setting_that_is_none_is_told(text: str) -> None:
    with pytest.raises(InvalidInput, match=f"{text!r} is not a setting"):
        body(settings=[text])


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("top_k=high", "top_k: 'high' is not a number", "Allowed: 0.001 to 1 with hgm3"),
        ("steps=nan", "steps: 'nan' is not a number", "Allowed: whole numbers, 1 to 100 with hgm3"),
        ("fps=fast", "fps: 'fast' is not a number", "Allowed: 1 to 240."),
        ("best_of=all", "best_of: 'all' is not a number", "Allowed: whole numbers, 1 to 8."),
        ("wings=2x", "wings: '2x' is not a number", "`marey models show NAME` lists the settings of a model."),
    ],
)
def test_a_value_that_is_no_number_is_told_with_those_allowed(text: str, message: str, hint: str) -> None:
    with pytest.raises(InvalidInput) as told:
        body(settings=["guidance=4", text])
    assert (told.value.where, told.value.message) == ("--set", message)
    assert (told.value.hint or "").startswith(hint)


def test_a_run_that_is_worse_exits_8_only_where_that_was_asked() -> None:
    worse = ended(regressed=True)
    check_evaluation(worse, fail_on_regression=False)
    with pytest.raises(Regressed, match="FID fell") as caught:
        check_evaluation(worse, fail_on_regression=True)
    assert caught.value.exit_code == 8
    for regressed in (False, None):
        check_evaluation(ended(regressed=regressed), fail_on_regression=True)


@pytest.mark.parametrize("state", ["failed", "cancelled"])
def test_a_run_that_is_not_done_exits_6(state: str) -> None:
    with pytest.raises(ItemsFailed, match=state) as caught:
        check_evaluation(ended(state=state), fail_on_regression=True)
    assert caught.value.exit_code == 6


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> tuple[typer.Typer, list[list[str]]]:
    """The real group around commands that only note what they were called with."""
    called: list[list[str]] = []
    app = typer.Typer(cls=schedules.ScheduleGroup)

    @app.command()
    def add(cron: str, bundle: str = typer.Option(...)) -> None:
        called.append(["add", cron, bundle])

    @app.command("list")
    def list_() -> None:
        called.append(["list"])

    return app, called


def test_a_cron_line_in_place_of_a_command_is_an_add(commands: tuple[typer.Typer, list[list[str]]]) -> None:
    app, called = commands
    runner = CliRunner()
    assert runner.invoke(app, ["0 3 * * 1", "--bundle", "hgm3"]).exit_code == 0
    assert runner.invoke(app, ["add", "0 3 * * 1", "--bundle", "hgm3"]).exit_code == 0
    assert runner.invoke(app, ["list"]).exit_code == 0
    assert called == [["add", "0 3 * * 1", "hgm3"]] * 2 + [["list"]]
    assert runner.invoke(app, ["nonsense"]).exit_code == 2
