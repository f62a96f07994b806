"""Edits of stored motions whose frames a model generates: its bundle, and the prompts that the text stage reads."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from marey.bundles.limits import edit_settings
from marey.bundles.scope import judges_meaning
from marey.core.errors import InvalidInput
from marey.core.sides import swap_sides
from marey.items.prompts import check_prompt
from marey.jobs import MotionRow
from marey.jobs.generators import GeneratorCapabilities
from marey.jobs.types import named_prompts, prompts_of_ops
from marey.motion.edits.steps import Step
from marey.registry import find_model
from marey.text.keys import scope_key
from marey.vocabulary.scope import ScopePolicy, match_scope, scope_of_prompts

CUTS = frozenset({"trim", "split", "loop", "reverse"})
"""Operations after which another prompt of several may be the last."""


@dataclass(frozen=True)
class EditGenerator:
    """The bundle that generates the frames of an edit.

    Attributes:
        capabilities: of the bundle.
        settings: of sampling, as given.
    """

    capabilities: GeneratorCapabilities
    settings: Mapping[str, float] = field(default_factory=dict[str, float])

    @property
    def licence(self) -> str:
        """Terms of the weights."""
        return self.capabilities.bundle.manifest.licence

    def columns(self, steps: Sequence[Step], policy: ScopePolicy) -> dict[str, Any]:
        """Return the fields of an item with these steps that say where and how it runs.

        Args:
            policy: of prompts with unknown actions.

        Raises:
            InvalidInput: an unknown setting, or a value out of range.
        """
        bundle = self.capabilities.bundle
        settings = edit_settings(bundle, self.settings)
        ops = [step.as_json() for step in steps]
        return {
            "model": bundle.manifest.model,
            "bundle": bundle.reference,
            "batch_key": _sha256(f"edit\n{bundle.reference}\n{json.dumps(settings, sort_keys=True)}"),
            "text_key": self.capabilities.several_key(prompts_of_ops(ops)),
            "text_batch_key": self.capabilities.text_batch_key,
            "settings": settings,
            **({} if policy == "ignore" else self._scope(named_prompts(ops))),
        }

    def _scope(self, prompts: Sequence[str]) -> dict[str, Any]:
        """Return the scope of the prompts of an item by their words, and the key of the encoder's verdict if that
        decides."""
        bundle, lists = self.capabilities.bundle, self.capabilities.bundle.manifest.actions
        if lists is None or not prompts:
            return {}
        scope = scope_of_prompts([match_scope(prompt, lists) for prompt in prompts])
        if scope.left is None or not judges_meaning(self.capabilities.text):
            return {"scope": scope.as_json()}
        key = scope_key("\n".join(prompts), bundle.reference, lists, of_edit=True)
        return {"scope": scope.as_json(), "scope_key": key}


def needs_model(steps: Sequence[Step]) -> bool:
    """Return True if a model generates frames for one of the steps."""
    return any(step.operation.needs_model for step in steps)


def check_generator(steps: Sequence[Step], generator: EditGenerator | None) -> None:
    """Check that a model is given if one is needed, and that it can generate frames around others.

    Raises:
        InvalidInput: it is missing, not used, or cannot.
    """
    if not needs_model(steps):
        if generator is not None:
            raise InvalidInput("no operation generates frames, so no model is used", where="model")
        return
    if generator is None:
        raise InvalidInput("is missing: operations generate frames", where="model")
    manifest = generator.capabilities.bundle.manifest
    spec = find_model(manifest.model)
    if spec is None or not spec.keeps_frames:
        raise InvalidInput(
            f"{manifest.name!r} cannot generate frames around others",
            where="model",
            hint="Use a bundle of the default model.",
        )


def with_prompts(steps: Sequence[Step], motion: MotionRow) -> tuple[Step, ...]:
    """Return the steps with checked prompts; an extension without one goes on with the motion's last prompt.

    Raises:
        InvalidInput: a prompt that no model reads, or an extension whose prompt is not known.
    """
    told: list[Step] = []
    for step in steps:
        values = dict(step.values)
        if step.operation.name == "extend" and values["prompt"] is None:
            values["prompt"] = _last_prompt(told, motion, step.where)
        if values.get("prompt"):
            values["prompt"] = check_prompt(values["prompt"], where=f"{step.where}.prompt")
        told.append(replace(step, values=values))
    return tuple(told)


def _last_prompt(before: Sequence[Step], motion: MotionRow, where: str) -> str:
    prompts: Any = motion.metadata.get("prompts")
    prompt = str(prompts[-1][1]) if prompts else motion.prompt
    cut = bool(prompts) and any(step.operation.name in CUTS for step in before)  # only the frames show what is left
    if not prompt or cut or any(step.operation.needs_model or "with" in step.values for step in before):
        raise InvalidInput(
            "is missing: which action goes on is not known", where=f"{where}.prompt", hint="Say what the person does."
        )
    for step in before:
        prompt = swap_sides(prompt) if step.operation.name == "mirror" else prompt
    return prompt


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
