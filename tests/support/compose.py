"""`docker-compose.yml` and the Dockerfile as tests read them: merged, with variables filled in as Compose does."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from tests.support.marey import REPOSITORY

COMPOSE = REPOSITORY / "docker-compose.yml"
DOCKERFILE = REPOSITORY / "deploy" / "docker" / "Dockerfile"
VARIABLE = re.compile(r"\$\$|\$\{(?P<name>\w+)(:-(?P<default>[^}]*))?\}")
SECONDS = {"s": 1, "m": 60}


@dataclass(frozen=True)
class Service:
    """A service of the file; `raw` is all that stands there."""

    name: str
    raw: Mapping[str, Any]

    @property
    def ours(self) -> bool:
        """True if the image is built here."""
        return "build" in self.raw

    @property
    def target(self) -> str:
        """The stage of the Dockerfile it runs."""
        return self.raw["build"]["target"]

    @property
    def command(self) -> list[str]:
        """Arguments after the image's entry point."""
        return self.raw["command"]

    @property
    def environment(self) -> dict[str, str]:
        """Variables as the container gets them."""
        return {name: str(value) for name, value in self.raw.get("environment", {}).items()}

    @property
    def secrets(self) -> list[str]:
        """Files under /run/secrets."""
        return self.raw.get("secrets", [])

    @property
    def check(self) -> list[str] | None:
        """The command that says whether it is healthy; None for one that ends."""
        found = self.raw["healthcheck"]
        return None if found.get("disable") else found["test"]

    @property
    def grace(self) -> float:
        """Seconds from the stop signal to SIGKILL; Compose's own default is 10."""
        return duration(self.raw.get("stop_grace_period", "10s"))


def filled(text: str, variables: Mapping[str, str]) -> str:
    """The text as Compose reads it, `$$` for a dollar."""

    def value(found: re.Match[str]) -> str:
        name = found["name"]
        return "$" if name is None else variables.get(name) or found["default"] or ""

    return VARIABLE.sub(value, text)


def read_compose(variables: Mapping[str, str] | None = None) -> dict[str, Any]:
    """The whole file."""

    def fill(node: Any) -> Any:
        if isinstance(node, dict):
            return {key: fill(value) for key, value in node.items()}
        if isinstance(node, list):
            return [fill(value) for value in node]
        return filled(node, variables or {}) if isinstance(node, str) else node

    return fill(yaml.safe_load(COMPOSE.read_text(encoding="utf-8")))


def services(variables: Mapping[str, str] | None = None) -> dict[str, Service]:
    """All services by name."""
    return {name: Service(name, raw) for name, raw in read_compose(variables)["services"].items()}


def duration(text: str) -> float:
    """Seconds of `30s` or `2m`."""
    return float(text[:-1]) * SECONDS[text[-1]]


def instructions(stage: str) -> list[tuple[str, str]]:
    """Instructions of a Dockerfile stage, after those of the stages it builds on."""
    stages: dict[str, list[tuple[str, str]]] = {}
    name = ""
    joined = DOCKERFILE.read_text(encoding="utf-8").replace("\\\n", " ")
    for line in joined.splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        verb, rest = line.split(maxsplit=1)
        if verb == "FROM":
            parent, _, name = rest.split()
            stages[name] = list(stages.get(parent, []))
        stages[name].append((verb, rest))
    return stages[stage]


def image_environment(stage: str) -> dict[str, str]:
    """Variables that the image brings."""
    pairs = (pair for verb, rest in instructions(stage) if verb == "ENV" for pair in rest.split())
    return dict(pair.split("=", 1) for pair in pairs)


def copied(stage: str) -> list[str]:
    """Paths that a stage copies out of the build context."""
    found: list[str] = []
    for verb, rest in instructions(stage):
        words = rest.split()
        if verb == "COPY" and not words[0].startswith("--from="):
            found += words[:-1]
    return found


def waits_for(service: Service) -> Sequence[str]:
    """Services that must be ready first."""
    return list(service.raw.get("depends_on", {}))
