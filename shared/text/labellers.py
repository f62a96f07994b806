"""Finding a labeller by its name in `TextSpec`."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from shared.bundles import find_bundle
from shared.errors import InvalidBundle, NotFound
from shared.text.keys import NO_LABELLER, labeller_bundle
from shared.text.roles import Frame, RoleLabeller


class NoLabeller:
    """Finds nothing: every graph is its motion node alone. For ablations; it has to be asked for by name."""

    name = NO_LABELLER
    sha256 = ""

    def label(self, sentences: Sequence[Sequence[str]]) -> list[tuple[Frame, ...]]:
        """No frames."""
        return [() for _ in sentences]


class OneAtATime:
    """A labeller that serves one thread after the other; their networks and tokenizers promise no more."""

    def __init__(self, labeller: RoleLabeller) -> None:
        self._labeller = labeller
        self._lock = threading.Lock()
        self.name = labeller.name
        self.sha256 = labeller.sha256

    def label(self, sentences: Sequence[Sequence[str]]) -> list[tuple[Frame, ...]]:
        """Its frames."""
        with self._lock:
            return self._labeller.label(sentences)


def load_labeller(name: str) -> RoleLabeller:
    """The labeller `light`, `bert-srl`, `none`, or the bundle of that name or path.

    Raises:
        NotFound: its bundle is not here.
        InvalidBundle: the bundle is no labeller.
    """
    if name == NO_LABELLER:
        return NoLabeller()
    try:
        bundle = find_bundle(labeller_bundle(name))
    except NotFound as error:
        if name == "bert-srl":
            error.hint = "Import AllenNLP's archive once: `python -m shared.text.convert bert-srl --help`."
        raise
    model = bundle.manifest.model
    if bundle.manifest.kind == "labeller" and model == "light":
        from shared.text.light import LightLabeller

        return LightLabeller.load(bundle)
    if bundle.manifest.kind == "labeller" and model == "bert-srl":
        from shared.text.bert_srl import BertLabeller

        return BertLabeller(bundle)
    raise InvalidBundle(
        f"is a {bundle.manifest.kind} ({model}), not a role labeller", where=str(bundle.path), hint="Use 'light'."
    )
