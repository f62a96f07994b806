"""Ranges of an item's model, where the model is installed beside the client.

The server checks everything against its bundle, whose ranges are as wide at most. What is not known here is left to it:
a bundle's name, a model without its plug-in, and a setting that this version of the model does not have.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from marey.items.problems import Problem
from marey.items.timeline import TIMELINE_HINT, no_timelines
from marey.items.values import outside_range
from marey.registry import ModelSpec, find_model


def check_ranges(values: Mapping[str, Any], line: int | None) -> tuple[dict[str, Any], list[Problem]]:
    """Return the usable fields of an item without what its model cannot do, and a problem for each of these.

    Raises:
        PluginError: the package of the model cannot be used.
    """
    seconds: float | None = values.get("seconds")
    settings: Mapping[str, float] = values.get("settings", {})
    wanted = seconds is not None or settings or "timeline" in values
    spec = find_model(values["model"]) if "model" in values and wanted else None
    if spec is None:
        return dict(values), []
    left, problems = dict(values), list[Problem]()
    if seconds is not None and (message := _outside(spec, seconds)):
        del left["seconds"]
        problems.append(Problem(line, "seconds", message))
    if "timeline" in values and not spec.keeps_frames:
        del left["timeline"]
        problems.append(Problem(line, "timeline", f"{no_timelines(spec.name)}. {TIMELINE_HINT}"))
    wrong = _unsettable(spec, settings)
    if wrong:
        left["settings"] = {name: value for name, value in settings.items() if name not in wrong}
        problems += [Problem(line, "settings", message) for message in wrong.values()]
    return left, problems


def _outside(spec: ModelSpec, seconds: float) -> str | None:
    limits = spec.limits
    if limits is None or limits.min_seconds <= seconds <= limits.max_seconds:
        return None
    return outside_range(seconds, limits.min_seconds, limits.max_seconds, spec.name)


def _unsettable(spec: ModelSpec, settings: Mapping[str, float]) -> dict[str, str]:
    """The message for each setting that the model has and that cannot have its value."""
    given = [setting for setting in spec.settings if setting.name in settings]
    problems = {setting.name: setting.problem(settings[setting.name]) for setting in given}
    return {name: f"{name}: {problem}" for name, problem in problems.items() if problem}
