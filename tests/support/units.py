"""The units of `deploy/systemd`, as systemd reads them: drop-ins, specifiers, credentials, environment files."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from marey.registry import model_names, streaming_models
from tests.support.marey import REPOSITORY

UNITS = REPOSITORY / "deploy" / "systemd"
COMMON, S3 = UNITS / "marey-.service.d" / "10-common.conf", UNITS / "marey-.service.d" / "20-s3.conf"
ENVIRONMENT = UNITS / "marey.env"
PROGRAM = "/opt/marey/.venv/bin/marey"
INSTANCES = (
    *(f"marey-worker@{queue}.service" for queue in (*model_names(), "text")),
    *(f"marey-live@{model}.service" for model in streaming_models()),
)
SERVICES = ("marey-migrate.service", "marey-api.service", "marey-scheduler.service", "marey-text.service", *INSTANCES)


@dataclass
class Unit:
    """A service unit with its drop-ins.

    Attributes:
        values: all values of each option of `[Service]`, in order.
    """

    name: str
    values: dict[str, list[str]] = field(default_factory=dict)

    def one(self, option: str) -> str | None:
        """The last value of an option."""
        return self.values.get(option, [None])[-1]

    @property
    def instance(self) -> str:
        """Value of %i."""
        return self.name.partition("@")[2].removesuffix(".service")

    @property
    def command(self) -> list[str]:
        """The arguments of its program."""
        program, *arguments = shlex.split((self.one("ExecStart") or "").replace("%i", self.instance))
        assert program == PROGRAM
        return arguments

    @property
    def credentials(self) -> dict[str, str]:
        """Names of credentials, and the files they come from."""
        return dict(value.split(":", 1) for value in self.values.get("LoadCredential", []))

    def environment(self, credentials: Path) -> dict[str, str]:
        """Its variables, with `credentials` for %d; settings of the environment file last, as systemd has it."""
        pairs = (pair for value in self.values.get("Environment", []) for pair in shlex.split(value))
        own = dict(pair.replace("%d", str(credentials)).split("=", 1) for pair in pairs)
        return {**own, **environment_file()}


def environment_file(path: Path = ENVIRONMENT) -> dict[str, str]:
    """The variables of an environment file."""
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
    return {name: "".join(shlex.split(value)) for name, _, value in (line.partition("=") for line in lines)}


def read_unit(name: str, drop_ins: tuple[Path, ...] = (COMMON,)) -> Unit:
    """A unit, or an instance of a template, with drop-ins."""
    head, at, _ = name.partition("@")
    unit = Unit(name)
    for path in (UNITS / (f"{head}@.service" if at else name), *drop_ins):
        for option, value in _options(path, "Service"):
            unit.values.setdefault(option, []).append(value)
    return unit


def replaced(folder: Path, changes: Mapping[str, str]) -> Path:
    """Copies of the units in which texts are replaced."""
    for path in UNITS.rglob("*"):
        if path.is_file():
            text = path.read_text(encoding="utf-8")
            for there, here in changes.items():
                text = text.replace(there, here)
            target = folder / path.relative_to(UNITS)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text)
    return folder


def _options(path: Path, section: str) -> Iterator[tuple[str, str]]:
    current = ""
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            current = line.strip("[]")
        elif line and not line.startswith(("#", ";")) and current == section:
            option, _, value = line.partition("=")
            yield option, value
