"""Resolve a model name, a bundle name or a path to one bundle."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager

from marey.bundles.bundle import Bundle
from marey.bundles.find import find_bundle, has_bundle, list_bundles
from marey.bundles.manifest import BundleManifest
from marey.bundles.places import STARTER, how_to_get, preferred
from marey.core.errors import InvalidBundle, NotFound, Refused
from marey.core.settings import Settings, settings


def choose_bundle(name: str, *, config: Settings | None = None, verify: bool = True) -> Bundle:
    """Return the generator bundle of a model (`hgm3`), a bundle's name, exact reference or path.

    Of a model's bundles it is the first that the model prefers (`ModelSpec.bundles`); else the first trained one by
    name; else the first with random weights. Bundles whose terms `MAREY_REQUIRE_LICENCE` refuses are passed over.

    Raises:
        NotFound: unknown bundle and unknown model.
        InvalidBundle: as `find_bundle`.
        Refused: as `find_bundle`, if every bundle of the model is.
    """
    config = config or settings()
    if "/" in name or name.startswith(".") or "@" in name or has_bundle(name, config):
        return find_bundle(name, config=config, verify=verify)
    refused: Refused | None = None
    for candidate in _bundles_of(name, config):
        try:
            return find_bundle(candidate, config=config, verify=verify)
        except Refused as error:
            refused = refused or error
    if refused is None:
        known = ", ".join(b.manifest.name for b in list_bundles(config=config, kind="generator"))
        raise NotFound(
            f"no model or bundle is named {name!r}",
            hint=f"Known here: {known or 'none'}. `marey models list` shows them; MAREY_MODELS names their folder."
            + how_to_get(name),
        )
    raise refused


def _bundles_of(model: str, config: Settings) -> Iterator[str]:
    """Yield the names of a model's bundles, the preferred ones first."""
    yield from (known for known in preferred(model) if has_bundle(known, config))
    found = [b.manifest for b in list_bundles(config=config, kind="generator") if b.manifest.model == model]
    yield from (each.name for each in sorted(found, key=lambda manifest: (manifest.random, manifest.name)))


def choose_live_bundle(model: str, *, config: Settings | None = None) -> Bundle:
    """Return the bundle that live workers of a model load: the one that `MAREY_LIVE_MODEL` names, if it is of this
    model; else as `choose_bundle`, which says what is raised."""
    config = config or settings()
    if config.live_model is not None:
        bundle = choose_bundle(config.live_model, config=config)
        if bundle.manifest.model == model:
            return bundle
    return choose_bundle(model, config=config)


@contextmanager
def named_by(field: str) -> Generator[None]:
    """Report an invalid bundle as an error of the request field that names it, not of the server's folder."""
    try:
        yield
    except (NotFound, InvalidBundle, Refused) as error:
        raise type(error)(error.message, where=field, hint=error.hint) from error


def choose_evaluator(name: str | None, *, generator: Bundle | None = None, config: Settings | None = None) -> Bundle:
    """Return the evaluator's bundle of this name or exact reference, hashes not checked; None = the installed one.

    Of several, that is the first trained one by name; else the first with random weights. Bundles that measure other
    motions than the generator's come last.

    Raises:
        NotFound: there is none.
        InvalidBundle, Refused: as `find_bundle`; or it is not an evaluator.
    """
    config = config or settings()
    if name is None:
        found = list(list_bundles(config=config, kind="evaluator"))
        if not found:
            raise NotFound(
                "no evaluator bundle is installed",
                hint="`marey train evaluator` trains one; MAREY_MODELS names its folder. "
                f"A trained one comes with `pip install {STARTER}`.",
            )
        name = min(
            (bundle.manifest for bundle in found),
            key=lambda each: (bool(generator and unlike(generator.manifest, each)), each.random, each.name),
        ).name
    bundle = find_bundle(name, config=config, verify=False)
    if bundle.manifest.kind != "evaluator":
        raise InvalidBundle(f"{bundle.manifest.name!r} is a {bundle.manifest.kind}, not an evaluator", where=name)
    return bundle


def unlike(generator: BundleManifest, evaluator: BundleManifest) -> tuple[str, object, object] | None:
    """Return the first property in which two bundles describe different motion: (property, evaluator's,
    generator's)."""
    for what, made, measured in (
        ("skeleton", generator.skeleton, evaluator.skeleton),
        ("feature layout", generator.layout, evaluator.layout),
        ("frame rate", generator.fps, evaluator.fps),
    ):
        if made is not None and measured is not None and made != measured:
            return what, made, measured
    return None
