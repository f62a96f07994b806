"""Capabilities of generator bundles, and conversion of items to rows of a job."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from marey.bundles import BrokenBundle, Bundle, TextSpec, scan_bundles
from marey.bundles.find import log_broken
from marey.bundles.limits import (
    check_constraints,
    check_seconds,
    check_settings,
    check_timeline,
    length_of,
    sampling_of,
    seconds_of,
    settings_of,
    stated_seconds_of,
    variety_settings,
)
from marey.bundles.scope import judges_meaning
from marey.core.errors import InvalidBundle, MareyError
from marey.core.settings import Settings
from marey.items.item import Item, Rows
from marey.items.timeline import prompts_with_rows
from marey.items.values import MAX_SEED
from marey.jobs import NewItem
from marey.text.keys import as_served, feature_key, resolve, scope_key
from marey.text.several import several_key
from marey.vocabulary.report import ScopeReport
from marey.vocabulary.scope import Scope


@dataclass(frozen=True)
class GeneratorCapabilities:
    """A generator bundle and its limits."""

    bundle: Bundle
    text: TextSpec
    """Text specification with all hashes."""
    min_seconds: float
    max_seconds: float

    def check_seconds(self, seconds: float | None) -> None:
        """See `check_seconds`."""
        check_seconds(self.bundle, seconds)

    def check_settings(self, values: Mapping[str, float]) -> dict[str, float]:
        """See `check_settings`."""
        return check_settings(self.bundle, values)

    def check_variety(self, level: str | None) -> None:
        """See `variety_settings`."""
        variety_settings(self.bundle, level)

    def check_timeline(self, timeline: Rows | None) -> None:
        """See `check_timeline`."""
        check_timeline(self.bundle, timeline)

    def check_constraints(self, item: Item) -> None:
        """See `check_constraints`."""
        check_constraints(self.bundle, item)

    def judge(self, item: Item, report: ScopeReport) -> Scope | None:
        """Return the scope of an item's prompts, and count it; None if the bundle lists no actions."""
        manifest, lengths = self.bundle.manifest, stated_seconds_of(self.bundle)
        rows = () if item.timeline is None else prompts_with_rows(item.prompt, item.timeline)
        return report.judge(item.prompt, manifest.name, manifest.actions, lengths=lengths, rows=rows)

    def text_key(self, item: Item) -> str:
        """Return the key of the features of an item's prompts."""
        if item.timeline is None:
            return feature_key(item.prompt, self.text)
        return self.several_key(prompt for _, prompt in prompts_with_rows(item.prompt, item.timeline))

    def several_key(self, prompts: Iterable[str]) -> str:
        """Return the key of the features of several prompts of one item."""
        return several_key(feature_key(prompt, self.text) for prompt in prompts)

    @cached_property
    def text_batch_key(self) -> str:
        """Return the key that prompts share whose features are made together."""
        return _sha256(self.text.model_dump_json())

    def scope_key(self, item: Item, scope: Scope | None) -> str | None:
        """Return the key of the encoder's verdict; None if the words decide."""
        lists = self.bundle.manifest.actions
        if lists is None or scope is None or scope.left is None or not judges_meaning(self.text):
            return None
        return scope_key(item.prompt, self.bundle.reference, lists, in_rows=item.timeline is not None)


@dataclass(frozen=True)
class GeneratorList:
    """The usable and the broken generator bundles of this machine."""

    found: tuple[GeneratorCapabilities, ...]
    broken: tuple[BrokenBundle, ...]
    """Broken bundles of any kind, since a broken manifest does not reveal its kind."""


def list_generators(config: Settings) -> GeneratorList:
    """List every generator bundle of this machine, by folder; a broken one is logged and does not hide others."""
    bundles = scan_bundles(config=config, kind="generator")
    found: list[GeneratorCapabilities] = []
    broken = list(bundles.broken)
    for bundle in bundles.found:
        try:
            found.append(capabilities_of(bundle, config))
        except MareyError as error:
            broken.append(BrokenBundle.of(bundle.path.name, error))
            log_broken(broken[-1])
    return GeneratorList(tuple(found), tuple(broken))


def capabilities_of(bundle: Bundle, config: Settings) -> GeneratorCapabilities:
    """Return the capabilities of a generator bundle.

    Raises:
        InvalidBundle: not a generator, or its manifest lacks fps or limits.
        NotFound: its text encoder or labeller is missing.
    """
    manifest = bundle.manifest
    if manifest.kind != "generator" or manifest.text is None or not manifest.fps:
        raise InvalidBundle(
            f"{manifest.name!r} is of the kind {manifest.kind}, not a text-to-motion generator", where=str(bundle.path)
        )
    low, high = seconds_of(bundle)
    settings_of(bundle)
    return GeneratorCapabilities(bundle, resolve(as_served(manifest.text, config=config), config=config), low, high)


def new_items(
    items: Iterable[tuple[Item, GeneratorCapabilities]], *, report: ScopeReport | None = None
) -> Iterator[NewItem]:
    """Yield one row per motion: prompt times variant, with a drawn seed where none was given.

    Args:
        report: examines and counts the scope of each prompt; None = scopes are not examined.
    """
    batch_keys: dict[tuple[str, str], str] = {}
    for index, (item, generator) in enumerate(items):
        reference = generator.bundle.reference
        values = sampling_of(generator.bundle, item) if item.settings or item.variety else {}
        settings = json.dumps(values, sort_keys=True)
        batch_key = batch_keys.setdefault((reference, settings), _sha256(f"{reference}\n{settings}"))
        seed = secrets.randbelow(MAX_SEED - item.variants + 2) if item.seed is None else item.seed
        scope = None if report is None else generator.judge(item, report)
        spec = replace(item, seconds=length_of(generator.bundle, item)).spec()
        text_key = generator.text_key(item)
        for variant in range(item.variants):
            yield NewItem(
                **spec,
                index=index,
                model=generator.bundle.manifest.model,
                bundle=reference,
                batch_key=batch_key,
                text_key=text_key,
                text_batch_key=generator.text_batch_key,
                seed=seed + variant,
                variant=variant,
                settings=dict(values),
                scope=None if scope is None else scope.as_json(),
                scope_key=generator.scope_key(item, scope),
            )


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
