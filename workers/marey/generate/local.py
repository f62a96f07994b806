"""`marey.generate`: load a model, generate clips."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.core.errors import InvalidBundle, InvalidInput
from marey.core.extras import extra
from marey.generate.oneshot import OneShot, Wanted
from marey.items.item import Item, read_items
from marey.items.problems import Problem
from marey.items.settings import BEST_OF, OUTPUT_FPS, REDRAWS
from marey.items.values import MAX_SEED
from marey.registry import find_model, model_names

if TYPE_CHECKING:
    from marey.bundles import Bundle
    from marey.motion.clip import MotionClip

Row = Item | Mapping[str, object] | str
"""A prompt, a dict with the fields of an item, or an `Item`."""


class LocalModel:
    """A model in the memory of this process. Not thread-safe.

    Attributes:
        name: name of its bundle.
        reference: its exact bundle, as `hgm3-starter@0123456789ab`.
        model: name of the model, as `hgm3`.
        licence: terms of its weights and of generated motions.
        is_random: True for weights that were never trained: motions do not follow the prompts.
    """

    def __init__(self, bundle: Bundle, studio: OneShot) -> None:
        self.name = bundle.manifest.name
        self.reference = bundle.reference
        self.model = bundle.manifest.model
        self.licence = bundle.manifest.licence
        self.is_random = bundle.manifest.random
        self._bundle = bundle
        self._studio = studio

    def generate(
        self,
        prompts: Iterable[Row] | str,
        *,
        seed: int | None = None,
        seconds: float | None = None,
        variants: int | None = None,
        fps: float | None = None,
        best_of: int | None = None,
        redraws: int | None = None,
        variety: str | None = None,
        settings: Mapping[str, float] | None = None,
        constraints: Sequence[Mapping[str, object]] | None = None,
    ) -> Sequence[MotionClip]:
        """Generate motions; equal prompts, seeds and settings give the same clips as a server.

        Args:
            prompts: one or several; a row's own values override the arguments below.
            seed: of variant 0 of each prompt, variant k has seed + k; None = drawn.
            seconds: length; None = what the prompt states, else the model decides.
            variants: motions of each prompt; None = 1.
            fps: frames a second of the clips; None = the model's.
            best_of: candidates of each motion, of which the best is kept, 1 to 8; None = 1.
            redraws: further rounds of candidates while none is good, 0 to 2; None = 0.
            variety: how much motions of a prompt differ: low, normal or high; None = normal.
            settings: of sampling, as `{"guidance": 4.5}`.
            constraints: paths of the root, poses and targets of hands, feet and head, for every prompt; see
                `docs/how-to/constraints.md`. A motion file that they name is read from the working directory.

        Returns:
            One clip per variant of each prompt, in that order: metres, Y up, facing +Z in frame 0.

        Raises:
            InvalidItems: with every problem of every prompt; nothing is generated then.
            InvalidInput: no prompts, or constraints that cannot be met; with the field in `where`.
        """
        made = self.stream(
            prompts, seed=seed, seconds=seconds, variants=variants, fps=fps, best_of=best_of, redraws=redraws,
            variety=variety, settings=settings, constraints=constraints,
        )  # fmt: skip
        return [*made]

    def stream(
        self,
        prompts: Iterable[Row] | str,
        *,
        seed: int | None = None,
        seconds: float | None = None,
        variants: int | None = None,
        fps: float | None = None,
        best_of: int | None = None,
        redraws: int | None = None,
        variety: str | None = None,
        settings: Mapping[str, float] | None = None,
        constraints: Sequence[Mapping[str, object]] | None = None,
    ) -> Iterator[MotionClip]:
        """Generate motions as `generate` does, and yield each when it is ready."""
        platform = {OUTPUT_FPS: fps, BEST_OF: best_of, REDRAWS: redraws}
        from marey.bundles.limits import length_of, sampling_of

        sampling = {**(settings or {}), **{name: value for name, value in platform.items() if value is not None}}
        defaults = {
            "seed": seed,
            "seconds": seconds,
            "variants": variants,
            "variety": variety,
            "settings": sampling or None,
        }
        rows = [prompts] if isinstance(prompts, str) else prompts
        raws = ((number, _raw(row, defaults)) for number, row in enumerate(rows, 1))
        asked = _constraints(constraints)
        items = [*read_items(raws, where="prompts", check=self._check)]
        wanted = [
            each
            for item in items
            for each in _wanted(item, length_of(self._bundle, item), sampling_of(self._bundle, item), asked)
        ]
        for _, clip, _ in self._studio.make(wanted):
            yield clip

    def edit(
        self, clip: MotionClip, ops: Sequence[Mapping[str, Any]], *, settings: Mapping[str, float] | None = None
    ) -> tuple[MotionClip, ...]:
        """Apply operations to a clip, as `marey.motion.edit` does, and generate the frames of those that need a model.

        Args:
            clip: metres, Y up, with the joints of the model.
            ops: as in JSON, such as `[{"op": "extend", "seconds": 2, "prompt": "a person sits down"}]`.
            settings: of sampling.

        Returns:
            One motion, or two for each `split`. Kept frames are those of the clip.

        Raises:
            InvalidInput: as `marey.motion.edit`; or the model cannot generate frames around others, or its tokens
                cannot show those of the clip.
        """
        from marey.bundles.limits import edit_settings
        from marey.motion.edits.editing import edit

        own = edit_settings(self._bundle, settings or {})
        return edit(clip, ops, model=self._studio.editor(own))

    def _check(self, values: Mapping[str, Any], line: int | None) -> Iterator[Problem]:
        """Yield the problems of a row that concern this model: lengths out of its range, unknown settings."""
        from marey.bundles.limits import FIELD_CHECKS

        for field, check in FIELD_CHECKS.items():
            if values.get(field) is None:
                continue
            try:
                check(self._bundle, values[field])
            except InvalidBundle:
                raise
            except InvalidInput as error:
                yield Problem(line, field, error.on_a_line)


def load(
    bundle: str | os.PathLike[str],
    *,
    body: str | os.PathLike[str] | None = None,
    rig_map: str | os.PathLike[str] | None = None,
    device: str | None = None,
    threads: int | None = None,
) -> LocalModel:
    """Load a model into this process.

    Args:
        bundle: a model (`hgm3`), a bundle (`hgm3-starter`), an exact bundle, or the path of its folder.
        body: of the motions: `standard`, or a rig or an npz file with other proportions; None = standard.
        rig_map: JSON file that says which joint of that rig is which part of the body, where joints are not found.
        device: `cpu`, `cuda` or `auto`; None = that of MAREY_DEVICE.
        threads: of the CPU; None = that of MAREY_THREADS, by default all cores.

    Raises:
        InvalidInput: the extra `worker` is not installed, or the device is unknown.
        NotFound, InvalidBundle: the bundle is unknown, damaged, or not a generator.
        NotFound, InvalidInput, InvalidFile: the file of the body is missing, or no human body.
    """
    with extra("worker"):
        from marey.bundles import choose_bundle
        from marey.bundles.body import read_body_for
        from marey.core.settings import settings
    changes = {"device": device, "threads": threads}
    config = settings().model_copy(update={name: value for name, value in changes.items() if value is not None})
    found = choose_bundle(os.fspath(bundle), config=config)
    if find_model(found.manifest.model) is None:
        raise InvalidBundle(
            f"is a bundle of {found.manifest.model!r}, which does not run here",
            where=str(found.path),
            hint=f"Models that run here: {', '.join(model_names())}.",
        )
    chosen = (
        None
        if body is None
        else read_body_for(found.manifest, os.fspath(body), None if rig_map is None else os.fspath(rig_map))
    )
    return LocalModel(found, OneShot(found, config, body=chosen))


def _raw(row: Row, defaults: Mapping[str, object]) -> object:
    """Return a row with defaults for its missing fields; settings are merged one by one."""
    own: object = {"prompt": row} if isinstance(row, str) else row.as_json() if isinstance(row, Item) else row
    if not isinstance(own, Mapping):
        return own
    whole = {**defaults, **{str(name): value for name, value in own.items() if value is not None}}
    if own.get("timeline") is not None and own.get("seconds") is None:
        whole.pop("seconds")  # a timeline has a length of its own
    if isinstance(row, Item) and row.variants == 1:
        whole["variants"] = defaults["variants"]
    shared, its = defaults["settings"], own.get("settings")
    if isinstance(shared, Mapping) and isinstance(its, Mapping):
        whole["settings"] = {**shared, **its}
    return whole


def _constraints(given: Sequence[Mapping[str, object]] | None) -> Sequence[Mapping[str, Any]]:
    """Check constraints, and read the poses that they name."""
    if given is None:
        return ()
    from marey.generate.poses import with_poses
    from marey.items.constraints import read_constraints

    return with_poses(read_constraints(given), Path())


def _wanted(
    item: Item, seconds: float | None, settings: Mapping[str, float], constraints: Sequence[Mapping[str, Any]]
) -> Iterator[Wanted]:
    from marey.generate.poses import constraints_of

    seed = secrets.randbelow(MAX_SEED - item.variants + 2) if item.seed is None else item.seed
    asked = constraints_of(item, constraints)
    for variant in range(item.variants):
        yield Wanted(item.prompt, seed + variant, seconds, settings, item.timeline, asked)
