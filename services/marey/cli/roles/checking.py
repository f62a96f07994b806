"""Check of a motion file: its quality, and whether it shows actions, for `marey eval check`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from marey.core.errors import InvalidInput
from marey.core.extras import extra


def check_file(path: Path, expect: str | None) -> dict[str, Any]:
    """Measure a motion file.

    Args:
        path: a file that `marey convert` reads, on the skeleton of 22 joints.
        expect: ids of actions of the vocabulary in order, as "jump; then sit"; None = not judged.

    Returns:
        The file, its quality record with the match by the selector, and `shows`: whether the referee sees the actions;
        None without `expect`.

    Raises:
        NotFound, InvalidFile: of the file.
        InvalidInput: another skeleton, under 4 frames, or an unknown action.
    """
    with extra("motion"):
        from marey.exporters import Coordinates
        from marey.exporters.convert import read_motion
        from marey.quality.clips import quality_of
        from marey.quality.limits import expected_of
        from marey.referee import Body, shows_in_order
        from marey.selector import RULES, WantedAction
        from marey.selector.records import match_steps
    actions = actions_of(expect)
    clip = read_motion(path, Coordinates())
    quality = quality_of(clip, expected_of(actions))
    if quality is None:
        raise InvalidInput(
            f"{clip.frames} frames of the skeleton {clip.skeleton.name!r}; quality needs 4 frames of the 22 joints of "
            "humanml3d",
            where=str(path),
        )
    steps = [(WantedAction(name),) for name in actions] if all(name in RULES for name in actions) else None
    quality = quality.model_copy(update={"match": match_steps(clip, steps)})
    shows = shows_in_order(actions, Body(clip.joints, clip.fps)) if actions else None
    return {"file": str(path), "quality": quality.model_dump(mode="json"), "expect": actions, "shows": shows}


def actions_of(expect: str | None) -> Sequence[str]:
    """Return the ids of "jump; then sit".

    Raises:
        InvalidInput: an empty part, or an action that the vocabulary does not have.
    """
    from marey.vocabulary.entries import load_vocabulary

    known = load_vocabulary().actions
    found = [] if expect is None else [part.strip().removeprefix("then ").strip() for part in expect.split(";")]
    for name in found:
        if name not in known:
            raise InvalidInput(f"unknown action {name!r}", where="--expect", hint=f"Known: {', '.join(known)}.")
    return found
