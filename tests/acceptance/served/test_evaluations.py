"""An evaluation as a studio runs it: command line, server, queue, generator, evaluator, report."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.marey import TINY, Marey, Serving

PROMPTS = "prompt,seconds,expected\n" + "".join(f"a person walks {n} steps,1.5,walk\n" for n in range(1, 33))


@pytest.fixture(scope="module")
def prompts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("prompts") / "studio.csv"
    path.write_text(PROMPTS)
    return path


@pytest.fixture(scope="module")
def first(served: tuple[Marey, Serving], prompts: Path) -> str:
    """A run of the studio's own prompts that is done."""
    ran = served[0]("eval", "run", "--bundle", TINY, "--split", prompts, "--name", "monday", "--wait").ok()
    return ran.out.split()[0]


def test_a_run_ends_in_a_report_in_three_formats(marey: Marey, first: str, tmp_path: Path) -> None:
    for ending in ("html", "json", "md"):
        marey("eval", "report", first, "-o", tmp_path / f"report.{ending}").ok()
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["prompts"], report["motions"], report["failed"]) == (32, 32, 0)
    assert report["generator"]["name"] == TINY
    assert report["evaluator"]["name"] == "judge"
    rows = {row["key"]: row["values"] for row in report["rows"]}
    assert rows["exported"]["r_precision_3_of_32"]["n"] == 32
    assert 0 <= rows["exported"]["obeyed"]["mean"] < 60  # random weights walk nowhere
    assert rows["exported"]["fid"]["mean"] > 0
    assert "three" in (tmp_path / "report.html").read_text().lower()
    assert "Prompt adherence" in (tmp_path / "report.md").read_text()


def test_the_same_run_again_is_compared_with_the_first_and_did_not_regress(
    marey: Marey, first: str, prompts: Path, tmp_path: Path
) -> None:
    again = marey("eval", "run", "--bundle", TINY, "--split", prompts, "--wait", "--fail-on-regression").ok()
    second = again.out.split()[0]
    marey("eval", "report", second, "-o", tmp_path / "second.json").ok()
    report = json.loads((tmp_path / "second.json").read_text())
    assert report["regressed"] is False
    assert [baseline["evaluation"] for baseline in report["baselines"]] == [first]
    assert {change["verdict"] for change in report["changes"]} == {"no difference found"}
    assert all(change["before"] == change["after"] for change in report["changes"])  # the same seeds, the same motions
    assert len(report["trend"]) == 2
    (compared,) = marey("eval", "compare", first, second, "--json").ok().lines
    told = {change["metric"]: change["verdict"] for change in compared["changes"]}
    assert told == {change["metric"]: change["verdict"] for change in report["changes"]}
    assert {each["metric"] for each in compared["others"]} >= {"fid", "skate"}


def test_a_file_without_prompts_is_refused_and_leaves_no_run(marey: Marey, tmp_path: Path) -> None:
    before = marey("eval", "list", "--json").ok().lines
    empty = tmp_path / "empty.csv"
    empty.write_text("prompt,seconds,expected\n")
    marey("eval", "run", "--bundle", TINY, "--split", empty).refused(2)
    assert marey("eval", "list", "--json").ok().lines == before
