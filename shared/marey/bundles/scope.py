"""Refusal of prompts with actions that their bundle does not know."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from marey.bundles.bundle import Bundle
from marey.bundles.manifest import TextSpec
from marey.core.errors import InvalidInput
from marey.items.problems import MAX_PROBLEMS, OutOfScope, Problem
from marey.vocabulary.report import MAX_BUNDLES, ScopeReport, refusal, says_known
from marey.vocabulary.scope import ActionLists, Scope, ScopePolicy, match_scope

MEANING_ENCODERS = ("minilm",)
"""Encoders that the limits of `marey.text.meaning` were set for; with others the words decide alone."""


def judges_meaning(text: TextSpec | None) -> bool:
    """Return True if the encoder of this specification decides what the words of prompts leave undecided."""
    return text is not None and text.encoder in MEANING_ENCODERS


def refuse_unknown(
    prompts: Iterable[tuple[int | None, str | None, str, Bundle]],
    *,
    where: str | None = None,
    unit: str = "line",
    match: Callable[[str, ActionLists], Scope] = match_scope,
) -> None:
    """Check that every prompt names only actions that its bundle knows, tries, or reads as a known one.

    Prompts that the words leave undecided pass: the encoder of their bundle decides them later.

    Args:
        prompts: line in the input, name of the row of a timeline, prompt, and the bundle that will read it.
        where: name of the input.
        unit: name of a line of it.
        match: by words, or by words and meaning.

    Raises:
        OutOfScope: with every prompt that does not, and what the bundles know.
        InvalidInput: a bundle lists no actions.
    """
    problems: list[Problem] = []
    known: dict[str, tuple[str, ...]] = {}
    total = 0
    for line, row, prompt, bundle in prompts:
        lists, name = bundle.manifest.actions, bundle.manifest.name
        if lists is None:
            raise InvalidInput(
                f"{name} lists no actions: whether it knows a prompt cannot be said",
                where="scope",
                hint="Choose the scope `warn` or `ignore`, or another bundle.",
            )
        scope = match(prompt, lists)
        message = refusal(scope)
        if message is None or (scope.left is not None and judges_meaning(bundle.manifest.text)):
            continue
        total += 1
        if len(known) < MAX_BUNDLES:
            known[name] = lists.known
        if len(problems) < MAX_PROBLEMS:
            problem = Problem(line, "prompt", message) if row is None else Problem(line, "timeline", f"{row} {message}")
            problems.append(problem)
    if total:
        knows = " ".join(says_known(name, actions) for name, actions in known.items())
        hint = f"{knows} The scope `warn` accepts such prompts."
        raise OutOfScope(problems, where=where, total=total, hint=hint, unit=unit)


def examine_prompts(
    prompts: Iterable[str],
    bundle: Bundle,
    policy: ScopePolicy,
    *,
    match: Callable[[str, ActionLists], Scope] | None = None,
    decided: Mapping[tuple[str, str], Scope] | None = None,
) -> ScopeReport | None:
    """Return the report on the scopes of prompts, each counted once; None with the policy `ignore`.

    Args:
        match: by words and meaning; None = by words.
        decided: the encoder's verdicts, by bundle and prompt.

    Raises:
        OutOfScope: policy `refuse`, and prompts name actions that the bundle does not know.
        InvalidInput: policy `refuse`, and the bundle lists no actions.
    """
    if policy == "ignore":
        return None
    distinct = dict.fromkeys(prompts)
    if policy == "refuse":
        refuse_unknown(((None, None, prompt, bundle) for prompt in distinct), match=match or match_scope)
    name, lists = bundle.manifest.name, bundle.manifest.actions
    report = ScopeReport(decided=decided or {})
    if match is not None and lists is not None:
        report.decided = {(name, prompt): match(prompt, lists) for prompt in distinct}
    for prompt in distinct:
        report.judge(prompt, name, lists)
    return report
