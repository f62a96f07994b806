"""Configuration files: a preset and what differs from it; each mistake is told with the file and the field."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import pytest

from marey.core.configs import Between, Count, ModelConfig, Share
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.data.prepared import PreparedData
from marey.registry import resolve, trainings
from marey.training.budget import Budget
from marey.training.config_file import list_fields, open_config, write_toml
from marey.training.optimisation import StageConfig
from marey.training.staging import choose_budget
from tests.support.prepared import write_prepared


@dataclass(frozen=True)
class Inner:
    """A table."""

    width: Count = 4
    share: Share = 0.5  # of something


@dataclass(frozen=True)
class Config(ModelConfig):
    """A configuration as a plug-in declares one."""

    name: str = "small"
    side: Literal["left", "right"] = "left"
    rate: Annotated[float, Between(0, above=True)] = 1.0
    """How fast it is,
    in turns."""
    on: bool = False
    pair: tuple[Share, Share] = (0.1, 0.9)
    windows: tuple[Count, ...] = (8,)
    inner: Inner = field(default_factory=Inner)
    train_pose: StageConfig = StageConfig(batch=8, epochs=3)

    def check(self) -> None:
        """Check one field against another."""
        if self.inner.width > self.windows[0]:
            raise InvalidInput("is too wide", where="inner.width")


def named(name: str, *, side: Literal["left", "right"] = "left") -> Config:
    if name != "small":
        raise InvalidInput(f"unknown configuration {name!r}", hint="Known: small.")
    return Config(side=side)


def opened(folder: Path, text: str, **choices: str) -> Config:
    file = folder / "mine.toml"
    file.write_text(text, encoding="utf-8")
    return open_config(named, str(file), choices)


def test_a_file_changes_its_preset_and_nothing_else(tmp_path: Path) -> None:
    text = (
        'preset = "small"\nside = "right"\nrate = 2\nwindows = [16, 32]\n[inner]\nwidth = 8\n[train_pose]\nbatch = 2\n'
    )
    found = opened(tmp_path, text)
    assert found == Config("mine", "right", 2.0, windows=(16, 32), inner=Inner(8), train_pose=StageConfig(2, epochs=3))
    assert isinstance(found.rate, float)
    assert Config.from_dict(found.to_dict()) == found
    assert opened(tmp_path, 'preset = "small"\nname = "own"\n').name == "own"


def test_a_name_is_a_preset(tmp_path: Path) -> None:
    assert open_config(named, "small", {"side": "right"}) == Config(side="right")
    with pytest.raises(InvalidInput, match="unknown configuration 'large'"):
        open_config(named, "large")
    with pytest.raises(NotFound, match=r"none\.toml: there is no such file"):
        open_config(named, str(tmp_path / "none.toml"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[inner]\nwidht = 3", r"mine\.toml: inner\.widht: is an unknown field\n  Did you mean width\?"),
        ("zzz = 3", r"mine\.toml: zzz: is an unknown field\n  Known: name, side"),
        ("inner = 3", r"mine\.toml: inner: is 3, not a table\n  Write \[inner\]\."),
        ("[side]\nx = 1", r"mine\.toml: side: is \{'x': 1\}, not \"left\" or \"right\""),
        ('side = "up"', r"mine\.toml: side: is 'up', not \"left\" or \"right\""),
        ("on = 1", r"mine\.toml: on: is 1, not true or false"),
        ('rate = "fast"', r"mine\.toml: rate: is 'fast', not a number"),
        ("rate = 0", r"mine\.toml: rate: is 0\.0, not above 0"),
        ("rate = nan", r"mine\.toml: rate: is nan, not above 0"),
        ("rate = inf", r"mine\.toml: rate: is inf, not above 0"),
        ("[inner]\nwidth = true", r"mine\.toml: inner\.width: is true, not a whole number"),
        ("[inner]\nwidth = 2.0", r"mine\.toml: inner\.width: is 2\.0, not a whole number"),
        ("[inner]\nwidth = 0", r"mine\.toml: inner\.width: is 0, not at least 1"),
        ("[inner]\nshare = 1.5", r"mine\.toml: inner\.share: is 1\.5, not 0 to 1"),
        ("pair = [0.1]", r"mine\.toml: pair: is \[0\.1\], not a list of 2, each a number, 0 to 1"),
        ("pair = [0.1, 3]", r"mine\.toml: pair\.1: is 3\.0, not 0 to 1"),
        ("windows = 3", r"mine\.toml: windows: is 3, not a list, each a whole number, at least 1"),
        ("[inner]\nwidth = 9", r"mine\.toml: inner\.width: is too wide"),
        ("[train_pose]\nema = 1", r"mine\.toml: train_pose\.ema: is 1\.0, not 0 to 0\.99999"),
    ],
)
def test_a_mistake_is_told_with_its_file_and_field(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InvalidFile, match=said):
        opened(tmp_path, f'preset = "small"\n{text}')


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('preset = "small"\nside =\n', r"mine\.toml: is not TOML: .*line 2"),
        ("\udce4", r"mine\.toml: is not UTF-8"),
        ('side = "left"', r"mine\.toml: preset: names no preset to inherit from\n  Begin the file with .* preset ="),
        ("preset = 3", r"mine\.toml: preset: is 3, not the name of a preset"),
        ('preset = "other.toml"', r"mine\.toml: preset: is 'other\.toml', not the name of a preset"),
        ('preset = "large"', r"mine\.toml: preset: unknown configuration 'large'\n  Known: small\."),
    ],
)
def test_a_file_that_is_no_configuration_is_refused(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "mine.toml"
    file.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InvalidFile, match=said):
        open_config(named, str(file))


def test_the_models_options_are_set_in_the_file(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"--side: cannot be used with .*mine\.toml"):
        opened(tmp_path, 'preset = "small"', side="right")


def test_a_written_file_has_every_field_and_reads_back(tmp_path: Path) -> None:
    config = Config("mine", "right", 2.5, True, (0.0, 1.0), (16, 32), Inner(8, 0.25), StageConfig(4))
    text = write_toml(config, "small")
    assert opened(tmp_path, text) == config
    assert "rate = 2.5  # How fast it is, in turns; a number, above 0\n" in text
    assert "share = 0.25  # of something; a number, 0 to 1\n" in text
    assert 'side = "right"  # "left" or "right"\n' in text


@pytest.mark.parametrize("training", trainings())
@pytest.mark.parametrize("preset", ["paper", "starter", "tiny"])
def test_every_preset_is_within_its_own_ranges(tmp_path: Path, training: str, preset: str) -> None:
    named_config = resolve(trainings()[training].config)
    file = tmp_path / f"{preset}.toml"
    file.write_text(write_toml(named_config(preset), preset), encoding="utf-8")
    assert open_config(named_config, str(file)) == named_config(preset)
    assert len(list_fields(named_config(preset))) > 20


def test_without_steps_and_minutes_the_configured_epochs_are_the_budget(tmp_path: Path) -> None:
    prepared = write_prepared(tmp_path / "prepared")
    budget = choose_budget(Config(), "pose", prepared, None, None)
    assert budget.steps == math.ceil(3 * len(PreparedData.open(prepared).split("train")) / 8)
    assert choose_budget(Config(), "pose", prepared, 5, None) == Budget(5)
    assert choose_budget(Config(), "pose", prepared, None, 2.0) == Budget(None, 2.0)
    with pytest.raises(InvalidInput, match="training needs a budget"):
        choose_budget(Config(train_pose=StageConfig(8)), "pose", prepared, None, None)
    with pytest.raises(InvalidInput, match="training needs a budget"):
        choose_budget(Config(), "all", prepared, None, None)
