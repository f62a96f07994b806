"""`marey eval` as a person types it, against a real API with a scheduler and a worker beside it.

The commands run in this process, all but one: a process each would take a minute of tests."""

from __future__ import annotations

import json
import os
import subprocess
import threading
from pathlib import Path
from uuid import uuid4

import pytest
from typer.testing import CliRunner

from marey.cli.main import app
from tests.support.evaluations import GENERATOR
from tests.support.live_evaluations import Studio
from tests.support.marey import COMMAND, REPOSITORY, Ran

MONDAYS = "0 3 * * 1"


class Marey:
    """The command line with a server."""

    def __init__(self, place: Studio) -> None:
        self.environment = {"MAREY_SERVER": place.api.url, "MAREY_KEY": place.api.key}

    def __call__(self, *arguments: object) -> Ran:
        """Run a command to its end."""
        done = CliRunner().invoke(app, list(map(str, arguments)), env=self.environment)
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        return Ran(done.exit_code, done.stdout, done.stderr)


@pytest.fixture
def marey(place: Studio) -> Marey:
    return Marey(place)


@pytest.fixture
def prompts(tmp_path: Path) -> Path:
    path = tmp_path / "studio.csv"
    path.write_text("prompt,seconds,expected\nwalk ahead,2,walk straight\nwalk and wave,,\n")
    return path


def test_a_run_prints_its_id_and_its_report_is_fetched_when_it_is_done(
    place: Studio, marey: Marey, prompts: Path, tmp_path: Path
) -> None:
    run = marey("eval", "run", "--bundle", GENERATOR, "--split", prompts, "--name", "release").ok().out.strip()
    marey("eval", "report", run, "-o", tmp_path / "early.html").refused(3, "the evaluation is planned")
    assert not (tmp_path / "early.html").exists()
    place.work()
    exact = marey("models", "show", GENERATOR, "--json").ok().lines[0]["bundle"]
    assert exact.startswith(f"{GENERATOR}@")
    assert [line.split("\t")[:6] for line in marey("eval", "list").ok().out.splitlines() if run in line] == [
        [run, "release", "done", "", exact, "studio.csv"]
    ]
    shown = marey("eval", "show", run).ok().out
    for said in ("state       done", "metric      made = 2", "metric      fid = not measured", "planned", "asked for"):
        assert said in shown
    for name in ("report.html", "report.json", "report.md"):
        marey("eval", "report", run, "-o", tmp_path / name).ok()
    assert json.loads((tmp_path / "report.json").read_text())["made"] == 2.0
    assert marey("eval", "report", run).ok().out == (tmp_path / "report.md").read_text()
    (tmp_path / "report.md").write_text("mine")
    marey("eval", "report", run, "-o", tmp_path / "report.md").refused(2, "already exists")
    marey("eval", "report", run, "-o", tmp_path / "report.md", "--overwrite").ok()
    marey("eval", "report", run, "-o", tmp_path / "report.pdf").refused(2, "html, json, md")


def test_waiting_exits_by_how_it_ended_and_8_when_it_is_worse(place: Studio, marey: Marey, tmp_path: Path) -> None:
    """The second run makes less than the first: more of its motions fail, within what a report allows."""
    many = tmp_path / "many.jsonl"
    many.write_text("".join(json.dumps({"prompt": f"walk {n} steps"}) + "\n" for n in range(100)))
    first = marey("eval", "run", "--bundle", GENERATOR, "--split", many).ok().out.strip()
    place.judge.timelines = True
    place.work()
    marey("eval", "wait", first, "--fail-on-regression").ok()
    place.judge.forget = 10
    try:
        asked = [*COMMAND, "eval", "run", "--bundle", GENERATOR, "--split", str(many), "--fail-on-regression", "--json"]
        running = subprocess.Popen(
            asked,
            cwd=REPOSITORY,
            env={**os.environ, **marey.environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        done = threading.Event()
        worker = threading.Thread(target=_work_until, args=(place, done))
        worker.start()
        try:
            out, err = running.communicate(timeout=120)
        finally:
            done.set()
            worker.join()
    finally:
        place.judge.forget, place.judge.timelines = 0, False
    assert running.returncode == 8, err
    (line,) = map(json.loads, out.splitlines())
    assert (line["state"], line["regressed"]) == ("done", True)
    assert f"marey eval report {line['id']}" in err
    marey("eval", "wait", line["id"]).ok()  # 8 only where it is asked for
    _compare(marey, first, line["id"])
    assert "regressed" in marey("eval", "list", "--state", "done").ok().out


def _compare(marey: Marey, better: str, worse: str) -> None:
    """The same of `eval compare`: a table, or a line of JSON; 8 only where it is asked for."""
    table = [line.split("\t") for line in marey("eval", "compare", better, worse).ok().out.splitlines()]
    assert table[0][:4] == ["obeyed", "100.00", "90.00", "-10.00"]
    assert table[0][5] == "worse"
    assert table[1][:4] == ["timeline_rows", "50.00", "45.00", "-5.00"]
    assert table[1][5] == "worse"
    assert ["made", "100", "90", "-10", "", "not paired"] in table
    (line,) = marey("eval", "compare", better, worse, "--json").ok().lines
    assert [(change["metric"], change["verdict"]) for change in line["changes"]] == [
        ("obeyed", "worse"),
        ("timeline_rows", "worse"),
    ]
    assert line["regressed"] is True
    command = ("eval", "compare", better, worse, "--fail-on-regression")
    marey(*command).refused(8, "obeyed fell from 100.0 to 90.0 %", f"marey eval report {worse}")
    marey("eval", "compare", worse, better, "--fail-on-regression").ok()
    marey("eval", "compare", worse, uuid4()).refused(3, "there is no such evaluation")


def _work_until(place: Studio, done: threading.Event) -> None:
    while not done.wait(0.05):
        place.work()


def test_a_run_that_failed_or_was_cancelled_is_6_and_a_timeout_7(place: Studio, marey: Marey, prompts: Path) -> None:
    run = marey("eval", "run", "--bundle", GENERATOR, "--split", prompts).ok().out.strip()
    marey("eval", "wait", run, "--timeout", 0.5).refused(7, "the time allowed has passed", f"marey eval wait {run}")
    assert "cancelled" in marey("eval", "cancel", run).ok().err
    marey("eval", "wait", run).refused(6, "cancelled by operator")
    prompts.write_text("prompt\nrefuse to walk\nwalk\n")
    run = marey("eval", "run", "--bundle", GENERATOR, "--split", prompts).ok().out.strip()
    place.work()
    marey("eval", "wait", run, "--fail-on-regression").refused(6, "1 of 2 motions are missing", "cannot be danced")


def test_bad_input_is_2_with_every_line_and_nothing_is_begun(marey: Marey, tmp_path: Path) -> None:
    before = marey("eval", "list").ok().out, marey("eval", "schedule", "list").ok().out
    bad = tmp_path / "bad.csv"
    for content, *said in (
        ("", "no prompt"),
        ("prompt,seconds\n", "no prompt"),
        ("prompt\nwalk\n", "more than one prompt"),
        ("prompt,speed\nwalk,1\nrun,2\n", "'speed' is not a known column", "prompt, seconds, expected"),
        (
            "prompt;seconds;expected\nwalk;15;fly\n\nrun;40;\n",
            f"{bad}: 3 problems",
            "line 2: seconds: 15 is outside 0.8 to 9.8",
            "line 2: expected",
            "line 4: seconds: 40 is outside 0.8 to 9.8",
        ),
        ("prompt,seconds,expected\nwalk,x,fly\nrun,-1,\n", "line 2: seconds", "line 2: expected", "line 3: seconds"),
    ):
        bad.write_text(content)
        for command in (["run"], ["schedule", MONDAYS]):
            marey("eval", *command, "--bundle", GENERATOR, "--split", bad).refused(2, *said)
    for arguments, said in (
        (["run", "--bundle", "gone"], "no model or bundle is named 'gone'"),
        (["run", "--bundle", GENERATOR, "--split", tmp_path / "none.csv"], "no such file"),
        (["run", "--bundle", GENERATOR, "--set", "guidance"], "such as guidance=4.5"),
        (["run", "--bundle", GENERATOR, "--baseline", uuid4()], "there is no such evaluation"),
        (["schedule", "0 3 * *", "--bundle", GENERATOR], "does not have five fields"),
        (["schedule", MONDAYS, "--bundle", GENERATOR, "--time-zone", "Mars/Olympus"], "there is no time zone"),
        (["schedule", "nonsense"], "No such command"),
        (["run"], "--bundle"),
    ):
        code = 3 if said == "no such file" else 2
        marey("eval", *arguments).refused(code, said)
    assert (marey("eval", "list").ok().out, marey("eval", "schedule", "list").ok().out) == before


def test_what_is_not_there_is_3(marey: Marey) -> None:
    for arguments in (
        ["show"], ["report"], ["cancel"], ["wait"], ["schedule", "pause"], ["schedule", "run"], ["schedule", "history"],
        ["schedule", "delete", "--yes"],
    ):  # fmt: skip
        marey("eval", *arguments, uuid4()).refused(3, "there is no such")


def test_a_schedule_is_made_in_its_short_form_and_lived_with(place: Studio, marey: Marey, prompts: Path) -> None:
    said = marey(
        *("eval", "schedule", MONDAYS, "--bundle", GENERATOR, "--split", prompts),
        *("--time-zone", "Europe/Berlin", "--name", "weekly"),
    ).ok()  # fmt: skip
    schedule = said.out.strip()
    assert "first at 20" in said.err
    long = marey("eval", "schedule", "add", MONDAYS, "--bundle", GENERATOR, "--regenerate", "--json").ok().lines[0]
    assert (long["cron"], long["request"]["source"], long["request"]["repeats"]) == (MONDAYS, "test", 20)
    marey("eval", "schedule", MONDAYS, "--bundle", GENERATOR, "--regenerate", "--repeats", 3).refused(
        2, "means --repeats 20", "Give one of the two."
    )
    (line,) = [each for each in marey("eval", "schedule", "list").ok().out.splitlines() if schedule in each]
    assert line.split("\t")[1:4] == ["weekly", MONDAYS, "Europe/Berlin"]
    assert "paused" in marey("eval", "schedule", "pause", schedule).ok().err
    assert "\tpaused\t" in marey("eval", "schedule", "list").ok().out
    assert "is next due at" in marey("eval", "schedule", "resume", schedule).ok().err
    run = marey("eval", "schedule", "run", schedule).ok().out.strip()
    place.work()
    assert marey("eval", "schedule", "history", schedule).ok().out.startswith(f"{run}\tweekly\tdone")
    marey("eval", "schedule", "delete", schedule, long["id"], "--yes").ok()
    assert schedule not in marey("eval", "schedule", "list").ok().out
    assert marey("eval", "show", run, "--json").ok().lines[0]["schedule"] is None


def test_help_names_exit_code_8(marey: Marey) -> None:
    assert "8 evaluation regressed" in marey("--help").ok().out
