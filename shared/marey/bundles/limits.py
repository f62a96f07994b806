"""Limits of a generator bundle: motion length and sampling settings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

from marey.bundles.bundle import Bundle
from marey.core.errors import InvalidBundle, InvalidInput
from marey.core.suggestions import did_you_mean
from marey.items.constraint_frames import for_clip, frames_to_last, last_frame
from marey.items.constraints import ROOT_PATH
from marey.items.item import Item, Rows
from marey.items.settings import BEST_OF, MAX_SETTING, PLATFORM_SETTINGS, REDRAWS
from marey.items.timeline import MAX_TIMELINE_SECONDS, TIMELINE_HINT, no_timelines, timeline_seconds
from marey.items.values import outside_range
from marey.motion.edits.licences import terms_with
from marey.registry import Setting, find_model
from marey.vocabulary.lengths import stated_length

DEFAULT_FPS = 20.0
"""Of a bundle whose manifest states none."""
MAX_FRAMES = 2**53
"""The largest integer that a float holds exactly: JSON holds whole numbers that no float can."""

LONGEST = ("longest_frames", "max_frames")
"""Parameters of a bundle that give its longest motion, the first that there is: where it makes longer motions than it
was trained on, and otherwise."""


def seconds_of(bundle: Bundle) -> tuple[float, float]:
    """Return the shortest and longest motion of a generator, in seconds: limits of its model, narrowed by the bundle.

    Raises:
        InvalidBundle: neither manifest nor model states them, or the manifest states more than the model can do.
    """
    spec = find_model(bundle.manifest.model)
    limits = None if spec is None else spec.limits
    low = _seconds(bundle, "min_frames", limits and limits.min_seconds)
    longest = next((name for name in LONGEST if name in bundle.manifest.parameters), LONGEST[-1])
    high = _seconds(bundle, longest, limits and limits.max_seconds)
    if not 0 < low <= high < math.inf:
        raise InvalidBundle(f"has an invalid range of lengths: {low:g} to {high:g} seconds", where=str(bundle.path))
    if limits is not None and not limits.min_seconds <= low <= high <= limits.max_seconds:
        raise InvalidBundle(
            f"makes motions of {low:g} to {high:g} seconds, and the model {bundle.manifest.model!r} makes those of "
            f"{limits.min_seconds:g} to {limits.max_seconds:g}",
            where=str(bundle.path),
        )
    return low, high


def stated_seconds_of(bundle: Bundle) -> tuple[float, float]:
    """Return the shortest and longest length in words that a generator uses, in seconds: where its model generates
    frames around others, a longer one than its longest motion is that of a timeline.

    Raises:
        InvalidBundle: as `seconds_of`.
    """
    low, high = seconds_of(bundle)
    return low, max(high, MAX_TIMELINE_SECONDS) if _keeps_frames(bundle) else high


def _keeps_frames(bundle: Bundle) -> bool:
    spec = find_model(bundle.manifest.model)
    return spec is not None and spec.keeps_frames


def _seconds(bundle: Bundle, name: str, of_model: float | None) -> float:
    """A length in the bundle's parameters, which are frames; where they do not give it, the model's."""
    value = bundle.manifest.parameters.get(name)
    if value is None and of_model is not None:
        return of_model
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < MAX_FRAMES:
        raise InvalidBundle(f"its parameters give no number as {name!r}", where=str(bundle.path))
    return value / (bundle.manifest.fps or DEFAULT_FPS)


def check_seconds(bundle: Bundle, seconds: float | None) -> None:
    """Validate the length of a motion against the model's limits.

    Raises:
        InvalidInput: out of range.
    """
    low, high = seconds_of(bundle)
    if seconds is not None and not low <= seconds <= high:
        raise InvalidInput(outside_range(seconds, low, high, bundle.manifest.name))


def check_timeline(bundle: Bundle, timeline: Rows | None) -> None:
    """Check that a bundle can generate timelines.

    Raises:
        InvalidInput: its model cannot generate motion between other frames.
    """
    if timeline is not None and not _keeps_frames(bundle):
        raise InvalidInput(no_timelines(bundle.manifest.model), hint=TIMELINE_HINT)


def check_constraints(bundle: Bundle, item: Item) -> None:
    """Check the constraints of an item against its motion, as far as its length is known before it is generated, and
    the terms of their poses against those of the bundle.

    Raises:
        InvalidInput: one is beyond the motion, two contradict each other there, a pose is of another skeleton, or no
            licence satisfies the terms of both; with the field in `where`.
    """
    if item.constraints is None:
        return
    terms_with(bundle.manifest.licence, item.constraints)
    _check_poses(bundle, item.constraints)
    model_fps = bundle.manifest.fps or DEFAULT_FPS
    fps, seconds = item.settings.get("fps", model_fps), length_of(bundle, item)
    if seconds is not None:
        frames = round(seconds * model_fps)
    else:
        low, high = (round(length * model_fps) for length in seconds_of(bundle))
        least = frames_to_last(item.constraints, fps, model_fps, low, high)
        frames = least if last_frame(item.constraints, fps, kind=ROOT_PATH) is not None else None
    if frames is not None:
        for_clip(item.constraints, frames, model_fps, fps)


def _check_poses(bundle: Bundle, constraints: Sequence[Mapping[str, Any]]) -> None:
    """Check that poses are of the skeleton of a bundle; those of motions that are still named are read later."""
    posed = [number for number, each in enumerate(constraints) if "joint_rotations" in each]
    if not posed or bundle.manifest.layout is None:
        return
    from marey.bundles.body import body_of  # numpy is loaded with the first pose
    from marey.motion.keyframes import ordered_rotations

    skeleton = body_of(bundle.manifest).skeleton
    for number in posed:
        ordered_rotations(constraints[number]["joint_rotations"], skeleton, f"constraints.{number}.joint_rotations")


def length_of(bundle: Bundle, item: Item) -> float | None:
    """Return the seconds of an item's motion: its own, or those that its prompt states; None = the model decides.

    A stated length beyond the bundle's longest motion is that of a timeline, which the generator makes of the prompt;
    one out of `stated_seconds_of` is not used, and `ScopeReport` warns of it.
    """
    if item.timeline is not None:
        return timeline_seconds(item.timeline)
    if item.seconds is not None:
        return item.seconds
    stated = stated_length(item.prompt)
    return None if stated.seconds is None else stated.within(*seconds_of(bundle))


def settings_of(bundle: Bundle) -> tuple[Setting, ...]:
    """Return the sampling settings of a generator, with the defaults of this bundle.

    For a model that is not installed here they come from the manifest, and their ranges are unknown.

    Raises:
        InvalidBundle: the manifest holds invalid settings.
    """
    own: Any = bundle.manifest.parameters.get("inference") or {}
    if not isinstance(own, dict):
        raise InvalidBundle("its parameters give no object as 'inference'", where=str(bundle.path))
    values = {name: value for name, value in cast("dict[str, Any]", own).items() if isinstance(value, int | float)}
    spec = find_model(bundle.manifest.model)
    if spec is not None:
        return tuple(replace(each, default=values.get(each.name, each.default)) for each in spec.settings)
    return tuple(
        Setting(name, -MAX_SETTING, MAX_SETTING, value, whole=isinstance(value, int)) for name, value in values.items()
    )


def variety_settings(bundle: Bundle, level: str | None) -> dict[str, float]:
    """Return the settings of a level of variety: factors of the model's on the defaults of this bundle, within range.

    Args:
        level: one of `VARIETIES`; None = as `normal`, which changes nothing.

    Raises:
        InvalidInput: the model has no such levels.
    """
    if level in (None, "normal"):
        return {}
    spec = find_model(bundle.manifest.model)
    if spec is None or spec.variety is None:
        raise InvalidInput(f"the model {bundle.manifest.model!r} has no variety {level!r}")
    factors = spec.variety.low if level == "low" else spec.variety.high
    known = {setting.name: setting for setting in settings_of(bundle)}
    return {
        name: round(min(max(known[name].default * factor, known[name].low), known[name].high), 6)
        for name, factor in factors.items()
    }


def sampling_of(bundle: Bundle, item: Item) -> dict[str, float]:
    """Return the settings that an item samples with: those of its variety, and its own before these."""
    return {**variety_settings(bundle, item.variety), **check_settings(bundle, item.settings)}


def check_settings(bundle: Bundle, values: Mapping[str, float]) -> dict[str, float]:
    """Return an item's settings as the model takes them: whole numbers as integers, without those that choose nothing.

    Raises:
        InvalidInput: the model has no such setting, or the value is out of range.
    """
    known = {setting.name: setting for setting in settings_of(bundle)}
    platform = {name: value for name, value in values.items() if name in PLATFORM_SETTINGS}
    own = {name: value for name, value in values.items() if name not in platform}
    for name in own:
        if name not in known:
            names = [*known, *PLATFORM_SETTINGS]
            message = f"unknown setting {name!r} of {bundle.manifest.name}{did_you_mean(name, names)}"
            raise InvalidInput(f"{message}; known: {', '.join(names)}")
    return {**{name: known[name].check(value) for name, value in own.items()}, **_platform_settings(bundle, platform)}


def edit_settings(bundle: Bundle, values: Mapping[str, float]) -> dict[str, float]:
    """Return the settings of a model that generates frames of an edit, as it takes them.

    Raises:
        InvalidInput: the model has no such setting, the value is out of range, or it is of whole motions.
    """
    if platform := [name for name in values if name in PLATFORM_SETTINGS]:
        raise InvalidInput(
            f"{platform[0]} is a setting of whole motions",
            where="settings",
            hint="Operations have `candidates`; `fps` is an operation.",
        )
    try:
        return check_settings(bundle, values)
    except InvalidInput as error:
        raise InvalidInput(error.message, where="settings", hint=error.hint) from error


FIELD_CHECKS: Mapping[str, Callable[[Bundle, Any], object]] = {
    "seconds": check_seconds,
    "settings": check_settings,
    "variety": variety_settings,
    "timeline": check_timeline,
}
"""Check of each field of an item that depends on its bundle; all raise `InvalidInput`."""


def _platform_settings(bundle: Bundle, values: Mapping[str, float]) -> dict[str, float]:
    """Return the settings that are not the network's; one candidate and no redraw are what an item has without them.

    Raises:
        InvalidInput: the model cannot choose among candidates.
    """
    found = {name: value for name, value in values.items() if (name, value) not in {(BEST_OF, 1), (REDRAWS, 0)}}
    spec = find_model(bundle.manifest.model)
    for name in (BEST_OF, REDRAWS):
        if name in found and not (spec and spec.best_of):
            raise InvalidInput(f"{name}: the model {bundle.manifest.model!r} does not choose among candidates")
    return found
