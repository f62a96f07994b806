"""Read each surface of the product as plain JSON values, without words: help texts and descriptions may change."""

from __future__ import annotations

import ast
import dataclasses
import enum
import importlib
import re
import subprocess
import typing
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from marey.registry import get_model, model_names

REPOSITORY = Path(__file__).resolve().parents[2]
ROOTS = ("shared", "services", "workers")
DEFINE_ERRORS = (
    *("marey.client.text_files", "marey.items.problems", "marey.jobs.errors", "marey.embedded.server"),
    *("marey.runtime.faults", "marey.streams.redis", "marey.text.rewriters"),
)
"""Modules that add to the tree of errors."""
WORDS = frozenset({"description", "summary", "title", "examples", "example"})


MODELS = REPOSITORY / "workers" / "marey" / "models"
"""Each model is a folder there, and has its own part of the surfaces."""


def sources() -> Iterator[tuple[Path, ast.Module]]:
    """Every module of the platform."""
    for root in ROOTS:
        yield from modules(path for path in (REPOSITORY / root).rglob("*.py") if MODELS not in path.parents)


def modules(paths: Iterable[Path]) -> Iterator[tuple[Path, ast.Module]]:
    """Modules, parsed, by path."""
    for path in sorted(paths):
        yield path, ast.parse(path.read_text(encoding="utf-8"))


# --- HTTP ---


def http_api() -> Any:
    """The OpenAPI document without its words."""
    from marey.api.app import create_app
    from marey.core.settings import Settings

    document = create_app(Settings()).openapi()
    return _without_words({name: document[name] for name in ("paths", "components")})


def _without_words(value: Any, *, names: bool = False) -> Any:
    """Leave out texts for people; `names`: the keys of this object are names of fields, which all count."""
    if isinstance(value, dict):
        return {
            key: _without_words(each, names=key in ("properties", "schemas", "paths"))
            for key, each in sorted(value.items())
            if names or key not in WORDS
        }
    return [_without_words(each) for each in value] if isinstance(value, list) else value


def errors() -> Any:
    """Every error type of the product: its problem type, HTTP status and exit code."""
    from marey.core import errors as tree

    for module in DEFINE_ERRORS:
        importlib.import_module(module)
    found: dict[str, dict[str, int]] = {}
    open_classes: list[type[tree.MareyError]] = [tree.MareyError]
    while open_classes:
        cls = open_classes.pop()
        open_classes += cls.__subclasses__()
        if cls.__module__.partition(".")[0] != "tests":
            found[cls.problem_type] = {"status": cls.status, "exit_code": cls.exit_code}
    return dict(sorted(found.items()))


# --- the command line ---


def command_line() -> Any:
    """Every command with its arguments and options: names, kind, whether required or repeatable, default; without the
    trainings of models."""
    found = _all_commands()
    train = found["commands"]["train"]["commands"]
    found["commands"]["train"]["commands"] = {name: train[name] for name in train if name not in model_names()}
    return found


def _all_commands() -> Any:
    import typer

    from marey.cli.main import app

    return _command(typer.main.get_command(app))


def _command(command: Any) -> Any:
    parameters = {
        (parameter.name or ""): {
            "flags": sorted([*parameter.opts, *parameter.secondary_opts]),
            "kind": _kind(parameter.type_descriptor.annotation),
            "required": parameter.required,
            "many": parameter.multiple or parameter.nargs != 1,
            "default": _default(parameter.default),
        }
        for parameter in command.params
        if not getattr(parameter, "hidden", False)
    }
    children = getattr(command, "commands", {})
    nested = {name: _command(each) for name, each in sorted(children.items()) if not each.hidden}
    return {"parameters": dict(sorted(parameters.items()))} | ({"commands": nested} if nested else {})


def _kind(annotation: Any) -> Any:
    """Values of a choice, else the name of the type; of a list, that of its elements."""
    inner = [each for each in typing.get_args(annotation) if each is not type(None)]
    if inner and typing.get_origin(annotation) is not typing.Literal:
        return _kind(inner[0])
    if isinstance(annotation, type) and issubclass(annotation, enum.Enum):
        return [each.value for each in annotation]
    return list(inner) or getattr(annotation, "__name__", str(annotation))


def _default(value: Any) -> Any:
    plain = isinstance(value, bool | int | float | str | None)
    return value if plain else "computed" if callable(value) else str(value)


# --- configuration ---


def settings() -> Any:
    """Every environment variable with its kind and default."""
    from marey.core.settings import Settings

    found = {f"MAREY_{name.upper()}": _setting(field) for name, field in Settings.model_fields.items()}
    read = re.compile(r"\"(MAREY_[A-Z0-9_]+)\"")
    for path, _ in sources():
        for name in read.findall(path.read_text(encoding="utf-8")):
            found.setdefault(name, "read by hand")
    return dict(sorted(found.items()))


def _setting(field: Any) -> Any:
    default = field.default if field.default_factory is None else "computed"
    return {"default": _default(default if not isinstance(default, Path) else "computed")}


# --- telemetry ---


def metrics() -> Any:
    """Every Prometheus metric: kind, labels, buckets, and which processes show it."""
    from marey.core import metrics as declared

    found: dict[str, Any] = {}
    for part, registry in sorted(declared.PARTS.items()):
        for collector in list(registry._collector_to_names):  # pyright: ignore[reportPrivateUsage]
            name = getattr(collector, "_name", None)
            if name is None:
                continue
            entry = found.setdefault(
                name,
                {
                    "kind": collector._type,  # type: ignore[attr-defined]
                    "labels": list(collector._labelnames),  # type: ignore[attr-defined]
                    "shown_by": [],
                },
            )
            if hasattr(collector, "_kwargs") and "buckets" in collector._kwargs:  # type: ignore[attr-defined]
                entry["buckets"] = [str(b) for b in collector._kwargs["buckets"]]  # type: ignore[attr-defined]
            entry["shown_by"].append(part)
    return dict(sorted(found.items()))


LEVELS = frozenset({"debug", "info", "warning", "error", "exception", "critical"})


def log_events() -> Any:
    """Every log event of the platform with the fields it carries, `…` where a name is computed."""
    return _events(sources())


def _events(parsed: Iterable[tuple[Path, ast.Module]]) -> Any:
    found: dict[str, set[str]] = defaultdict(set)
    for _, tree in parsed:
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute) or not node.args:
                continue
            if node.func.attr in LEVELS and isinstance(node.func.value, ast.Name) and node.func.value.id == "log":
                fields = {keyword.arg or "…" for keyword in node.keywords} - {"exc_info"}
                found[_pattern(node.args[0])] |= fields
    return {event: sorted(fields) for event, fields in sorted(found.items())}


def _pattern(node: ast.expr) -> str:
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values)
    return "…"


# --- queues and Redis ---


def queue() -> Any:
    """Names on Redis and in Celery: other releases and other processes use the same."""
    from marey.api import rates
    from marey.db import EVENT_CHANNEL
    from marey.db.database import QUEUE_CHANNEL
    from marey.jobs import TEXT_QUEUE
    from marey.runtime.app import DRAIN, create_app
    from marey.streams.notifier import KEY
    from marey.streams.redis import stream_key

    app = create_app("redis://127.0.0.1:6379/0")
    return {
        "task": DRAIN,
        "serializer": app.conf.task_serializer,
        "text_queue": TEXT_QUEUE,
        "channels": sorted([QUEUE_CHANNEL, EVENT_CHANNEL]),
        "stream_keys": [stream_key("ID", part) for part in ("frames", "lease", "fence", "control")],
        "streams_begun": KEY,
        "rates_prefix": rates.PREFIX,
    }


# --- files ---


def files() -> Any:
    """Keys of the files that the product writes."""
    from marey.bundles.manifest import BundleManifest, TextSpec
    from marey.client.manifest import COLUMNS
    from marey.core.frame_layout import HEADER, MAGIC, VERSION
    from marey.data import manifest as prepared
    from marey.evaluator.report import Report
    from marey.items.item import COLUMNS as ITEM_COLUMNS
    from marey.motion.clip import KEYS
    from marey.training.checkpoint import TrainingState
    from marey.training.parts import TrainedPart

    def fields(cls: Any) -> list[str]:
        names = cls.model_fields if hasattr(cls, "model_fields") else [field.name for field in dataclasses.fields(cls)]
        return sorted(names)

    return {
        "npz": sorted(KEYS),
        "item": sorted(ITEM_COLUMNS),
        "manifest_csv": list(COLUMNS),
        "bundle_manifest": {"manifest": fields(BundleManifest), "text": fields(TextSpec)},
        "report": fields(Report),
        "live_frame": {"magic": MAGIC.decode(), "version": VERSION, "header": HEADER.format},
        "prepared": {
            "format": prepared.FORMAT,
            "files": sorted([*prepared.FILES, prepared.MANIFEST, prepared.TEXTS]),
            "manifest": fields(prepared.Manifest),
            "clip": fields(prepared.Clip),
            "measured": fields(prepared.Measured),
        },
        "checkpoint": {"state": fields(TrainingState), "part": fields(TrainedPart)},
    }


def bundle_tensors() -> Any:
    """Those of the shipped bundles that no generator model reads."""
    return {
        name: found
        for model, bundles in _tensors().items()
        if model not in model_names()
        for name, found in bundles.items()
    }


def _tensors() -> dict[str, dict[str, Any]]:
    """Names, shapes and kinds of the tensors in the shipped bundles, and the configuration's keys, by model."""
    import json

    from safetensors import safe_open

    from marey.bundles import Bundle

    found: dict[str, dict[str, Any]] = defaultdict(dict)
    for manifest in sorted((REPOSITORY / "models").glob("*/manifest.json")):
        document = json.loads(manifest.read_text(encoding="utf-8"))
        tensors: dict[str, str] = {}
        for shard in sorted(manifest.parent.glob("*.safetensors")):
            with safe_open(shard, "numpy") as opened:
                for name in opened.keys():  # noqa: SIM118  (not a mapping)
                    part = opened.get_slice(name)
                    tensors[f"{shard.name}:{name}"] = f"{part.get_dtype()} {part.get_shape()}"
        found[document["model"]][manifest.parent.name] = {
            "reference": Bundle.open(manifest.parent, verify=False).reference,
            "parameters": _keys(document["parameters"]),
            "tensors": tensors,
        }
    return found


def _keys(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _keys(each) for key, each in sorted(value.items())}
    return type(value).__name__


# --- the database ---


def database(pg_dump: Path, url: str) -> list[str]:
    """The schema as `pg_dump` writes it, without comments and session settings."""
    text = subprocess.run(
        [pg_dump, "--schema-only", "--no-owner", "--no-privileges", "--dbname", url.replace("+psycopg", "")],
        check=True,
        capture_output=True,
        text=True,
        timeout=60,
    ).stdout
    noise = re.compile(r"^(--.*|SET .*|SELECT pg_catalog\..*|\\(un)?restrict .*)?$")
    return [line.rstrip() for line in text.splitlines() if not noise.match(line)]


# --- models ---


def of_model(model: str) -> Any:
    """The part of a model: its settings, configurations, trainings and bundles, and the log events of its own code."""
    spec = get_model(model)
    configs = importlib.import_module(spec.training.config.partition(":")[0]).CONFIGS if spec.training else {}
    return {
        "settings": {s.name: [s.low, s.high, s.default, s.whole] for s in spec.settings},
        "configurations": {name: dataclasses.asdict(config) for name, config in configs.items()},
        "command_line": _all_commands()["commands"]["train"]["commands"].get(model),
        "bundle_tensors": _tensors()[model],
        "log_events": _events(modules((MODELS / model).rglob("*.py"))),
    }


SURFACES: dict[str, Callable[[], Any]] = {
    "http_api": http_api,
    "errors": errors,
    "command_line": command_line,
    "settings": settings,
    "metrics": metrics,
    "log_events": log_events,
    "queue": queue,
    "files": files,
    "bundle_tensors": bundle_tensors,
}
"""By the name of the recorded file; `database` and `events` want a server and stand apart."""
