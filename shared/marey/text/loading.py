"""Load an encoder, a labeller or a rewriter by its name in `TextSpec`.

Each is imported on first use: a process that reads prompts with MiniLM never imports `transformers`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from marey.bundles import find_bundle
from marey.core.errors import InvalidBundle, NotFound
from marey.core.settings import settings
from marey.text.encoders import WIDTHS, TextEncoder, find_encoder, find_weights
from marey.text.keys import ASKING, NO_LABELLER, labeller_bundle
from marey.text.labellers import NoLabeller
from marey.text.rewriters import NoRewriter, PromptRewriter, RulesRewriter
from marey.text.roles import RoleLabeller
from marey.text.wordings import Wording
from marey.vocabulary.entries import load_vocabulary


def load_encoder(name: str, path: Path | None = None) -> TextEncoder:
    """Load the encoder `name` from the folder `path`, or from where it is installed.

    Raises:
        InvalidBundle: no such encoder, or its bundle is damaged.
        NotFound: its weights are not installed.
        InvalidFile: they are another encoder's, damaged, or not safetensors.
    """
    if name not in WIDTHS:
        raise InvalidBundle(f"unknown text encoder {name!r}", hint=f"Known: {', '.join(WIDTHS)}.")
    if name == "minilm":
        from marey.text.minilm_encoder import MiniLMEncoder

        return MiniLMEncoder(find_encoder(name, path))
    folder = path or find_weights(name)
    if name.startswith("clip"):
        from marey.text.clip_encoder import ClipEncoder

        return ClipEncoder(name, folder)
    if name.startswith("distilbert"):
        from marey.text.distilbert_encoder import DistilBertEncoder

        return DistilBertEncoder(name, folder)
    from marey.text.t5_encoder import T5Encoder

    return T5Encoder(name, folder)


def load_labeller(name: str) -> RoleLabeller:
    """The labeller `light`, `bert-srl`, `none`, or the bundle of that name or path.

    Raises:
        NotFound: its bundle is not installed.
        InvalidBundle: the bundle is no labeller.
    """
    if name == NO_LABELLER:
        return NoLabeller()
    try:
        bundle = find_bundle(labeller_bundle(name))
    except NotFound as error:
        if name == "bert-srl":
            error.hint = "Import AllenNLP's archive once: `marey models import allennlp-srl`."
        raise
    model = bundle.manifest.model
    if bundle.manifest.kind == "labeller" and model == "light":
        from marey.text.light import LightLabeller

        return LightLabeller.load(bundle)
    if bundle.manifest.kind == "labeller" and model == "bert-srl":
        from marey.text.bert_srl import BertLabeller

        return BertLabeller(bundle)
    raise InvalidBundle(
        f"is a {bundle.manifest.kind} ({model}), not a role labeller", where=str(bundle.path), hint="Use 'light'."
    )


def load_rewriter(
    name: str, labeller: RoleLabeller, wording: Wording = "caption", style: Sequence[str] = ()
) -> PromptRewriter:
    """The rewriter of that name; `openai` and `tca` write in the wording of the training texts, and captions in the
    style of those of `style`; see `TextSpec`.

    Raises:
        InvalidBundle: there is none, or `tca` for descriptions, which may use other verbs anyway.
        InvalidInput: `openai` or `tca` without their settings.
    """
    if name == "none":
        return NoRewriter()
    if name == "rules":
        from marey.text.spelling import Speller

        return RulesRewriter(labeller, Speller.load())
    if name in ASKING:
        from marey.text.openai_rewriter import Endpoint, OpenAIRewriter
        from marey.text.wordings import alignment, question_of

        if name == "tca" and wording != "caption":
            raise InvalidBundle("the rewriter 'tca' writes captions", where=wording, hint="Use the rewriter openai.")
        question = alignment(load_vocabulary(), style) if name == "tca" else question_of(wording, style)
        return OpenAIRewriter(Endpoint.of(settings()), question, name)
    raise InvalidBundle(f"unknown prompt rewriter {name!r}", hint="Known: none, rules, openai, tca.")
