"""`marey eval adherence` and `marey train ablate`: the report of a random bundle, and what is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from typer.testing import CliRunner

from marey.cli.main import app
from marey.cli.roles import protocol
from marey.core.errors import InvalidInput
from marey.generation.candidates import best_clips
from marey.models.hgm3 import ablation
from marey.models.hgm3.bundle import random_bundle
from marey.models.hgm3.generate import Generator, SamplingSettings
from marey.training.ablation import DECIDES, AblationRequest, evaluation_texts, judge
from marey.training.adherence import finished
from tests.support.ablations import judge_by_two_prompts


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(random_bundle(tmp_path_factory.mktemp("bundle") / "tiny", "tiny").path)


def test_a_report_counts_each_prompt_and_seed(bundle: str, tmp_path: Path) -> None:
    options = ["--seeds", "2", "--every", "50", "--set", "steps=2", "-o", str(tmp_path), "--json"]
    done = CliRunner().invoke(app, ["eval", "adherence", bundle, *options])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "report.json").read_text())
    assert json.loads(done.stdout) == found
    assert len(found["trials"]) == 8
    assert found["settings"]["steps"] == 2
    assert found["summary"]["one action"]["clips"] > 0
    assert "| one action |" in (tmp_path / "report.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--set", "steps"), "not a setting"),
        (("--set", "steps=many"), "steps: 'many' is not a number"),
        (("--set", "wings=2"), "unknown setting 'wings' of tiny"),
        (("--set", "steps=101"), "steps: 101 is outside 1 to 100"),
        (("--set", "motion_steps=11"), "must not decrease: motion_steps 11, action_steps"),
        (("--prompts", "own"), "there is no set 'own'"),
        (("--steers", "2"), "has no live sessions"),
    ],
)
def test_what_cannot_be_measured_is_told(bundle: str, arguments: tuple[str, ...], message: str) -> None:
    done = CliRunner().invoke(app, ["eval", "adherence", bundle, "--every", "100", *arguments])
    assert done.exit_code == InvalidInput.exit_code
    assert message in done.stderr


def test_an_ablation_that_a_model_has_not_is_told_with_those_it_has(bundle: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["train", "ablate", "data", bundle, "-o", str(tmp_path), "--what", "depth"])
    assert done.exit_code == InvalidInput.exit_code
    assert "has no ablation 'depth'" in done.stderr
    assert "masks (Hard and random masks" in done.stderr


def test_an_ablation_judges_what_the_network_makes(
    bundle: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bundle whose rules draw nods is judged without them: they would be the same in every row."""
    shutil.copytree(bundle, tmp_path / "tiny")
    file = tmp_path / "tiny" / "manifest.json"
    manifest = json.loads(file.read_text())
    manifest["text"]["plain_action"] = True
    file.write_text(json.dumps(manifest))
    generator = Generator.load(str(tmp_path / "tiny"), device="cpu", threads=1)
    assert generator.bundle.manifest.draws_bearings
    asked = list[bool]()

    def watched(some: Any, requests: Any, settings: Any) -> Any:
        asked.extend(request.drawing for request in requests)
        return finished(some, requests, settings)

    monkeypatch.setattr("marey.training.adherence.finished", watched)
    judge_by_two_prompts(monkeypatch)
    rates = judge(generator, evaluation_texts(generator), SamplingSettings(steps=2, motion_steps=0, action_steps=0))
    assert asked == [False, False]
    assert 0 <= rates[DECIDES] <= 1


def test_an_evaluator_measures_the_rows_of_an_ablation(
    bundle: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def measure_rows(data: Path, evaluator: str, repeats: int) -> Any:
        return lambda generator, settings, folder: {"FID": len(evaluator) + repeats, "data": str(data)}

    def ablate(request: AblationRequest) -> str:
        return str(request.measured(generator=None, settings=None, about="row"))

    monkeypatch.setattr(protocol, "measure_rows", measure_rows)
    monkeypatch.setattr(ablation, "ablate_passes", ablate)
    words = ["train", "ablate", "data", bundle, "-o", str(tmp_path), "--what", "passes"]
    done = CliRunner().invoke(app, [*words, "--evaluator", "judge", "--repeats", "3"])
    assert done.stdout.strip() == "{'FID': 8, 'data': 'data'}", done.output
    assert CliRunner().invoke(app, words).stdout.strip() == "{}"


def test_actions_are_measured_by_their_held_out_prompts(bundle: str, tmp_path: Path) -> None:
    picture = tmp_path / "bow.png"
    options = ["--action", "bow", "--seeds", "1", "--set", "steps=2", "-o", str(tmp_path), "--json"]
    done = CliRunner().invoke(app, ["eval", "actions", bundle, *options, "--picture", str(picture)])
    assert done.exit_code == 0, done.output
    with Image.open(picture) as drawn:
        assert drawn.width > 600  # a tile of the only action
    found = json.loads((tmp_path / "report.json").read_text())
    assert json.loads(done.stdout) == found
    (rate,) = found["actions"]
    assert (rate["action"], rate["authors"], rate["standing"]) == ("bow", 2, "unproven")
    assert len(found["trials"]) == rate["motions"] >= 10
    assert "| bow |" in (tmp_path / "report.md").read_text()


def test_a_picture_of_actions_is_a_png(bundle: str, tmp_path: Path) -> None:
    options = ["--action", "bow", "--seeds", "1", "--picture", str(tmp_path / "bow.jpg")]
    done = CliRunner().invoke(app, ["eval", "actions", bundle, *options])
    assert done.exit_code == InvalidInput.exit_code
    assert "is a .png, not .jpg" in done.stderr


def test_the_best_of_several_candidates_is_measured(bundle: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plans = list[int]()

    def watched(*arguments: Any, **more: Any) -> Any:
        plans.append(arguments[3].best_of)
        return best_clips(*arguments, **more)

    monkeypatch.setattr("marey.generation.candidates.best_clips", watched)
    options = ["--action", "bow", "--seeds", "1", "--set", "steps=2", "--set", "best_of=2", "--json"]
    done = CliRunner().invoke(app, ["eval", "actions", bundle, *options])
    assert done.exit_code == 0, done.output
    assert set(plans) == {2}
    assert json.loads(done.stdout)["settings"]["best_of"] == 2


def test_an_action_without_prompts_is_told_with_those_that_have_some(bundle: str) -> None:
    done = CliRunner().invoke(app, ["eval", "actions", bundle, "--action", "levitate"])
    assert done.exit_code == InvalidInput.exit_code
    assert "no prompts for 'levitate'" in done.stderr
    assert "walk-backward" in done.stderr


def test_minimal_pairs_are_measured_by_property(bundle: str, tmp_path: Path) -> None:
    options = ["--property", "duration", "--seeds", "1", "--set", "steps=2", "-o", str(tmp_path), "--json"]
    done = CliRunner().invoke(app, ["eval", "pairs", bundle, *options])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "report.json").read_text())
    assert json.loads(done.stdout) == found
    (rate,) = found["properties"]
    assert (rate["property"], rate["motions"]) == ("duration", len(found["motions"]))
    assert all(0 < motion["value"] <= 9.8 for motion in found["motions"])
    assert "| duration |" in (tmp_path / "report.md").read_text()


def test_a_property_without_pairs_is_told_with_those_that_have_some(bundle: str) -> None:
    done = CliRunner().invoke(app, ["eval", "pairs", bundle, "--property", "colour"])
    assert done.exit_code == InvalidInput.exit_code
    assert "no pairs for 'colour'" in done.stderr
    assert "side, count, order, direction, speed, duration" in done.stderr
