"""Refusal of prompts with actions that their bundle does not know."""

from __future__ import annotations

from collections.abc import Iterable

from marey.bundles.bundle import Bundle
from marey.core.errors import InvalidInput
from marey.items.item import MAX_PROBLEMS, OutOfScope, Problem
from marey.vocabulary.report import MAX_BUNDLES, refusal, says_known
from marey.vocabulary.scope import match_scope


def refuse_unknown(prompts: Iterable[tuple[int | None, str, Bundle]], *, where: str | None = None) -> None:
    """Check that every prompt names only actions that its bundle knows, tries, or reads as a known one.

    Args:
        prompts: line in the input, prompt, and the bundle that will read it.
        where: name of the input.

    Raises:
        OutOfScope: with every prompt that does not, and what the bundles know.
        InvalidInput: a bundle lists no actions.
    """
    problems: list[Problem] = []
    known: dict[str, tuple[str, ...]] = {}
    total = 0
    for line, prompt, bundle in prompts:
        lists, name = bundle.manifest.actions, bundle.manifest.name
        if lists is None:
            raise InvalidInput(
                f"{name} lists no actions: whether it knows a prompt cannot be said",
                where="scope",
                hint="Choose the scope `warn` or `ignore`, or another bundle.",
            )
        message = refusal(match_scope(prompt, lists))
        if message is None:
            continue
        total += 1
        if len(known) < MAX_BUNDLES:
            known[name] = lists.known
        if len(problems) < MAX_PROBLEMS:
            problems.append(Problem(line, "prompt", message))
    if total:
        knows = " ".join(says_known(name, actions) for name, actions in known.items())
        raise OutOfScope(problems, where=where, total=total, hint=f"{knows} The scope `warn` accepts such prompts.")
