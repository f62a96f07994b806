"""`POST /v1/texts/parse`: the graph a prompt becomes."""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field

from services.api.auth import Parser
from services.api.problems import RESPONSES
from shared.bundles import TextSpec, choose_bundle, named_by
from shared.errors import InvalidInput, Unreachable
from shared.items import MODEL
from shared.text.keys import as_served
from shared.text.prompts import check_prompt

if TYPE_CHECKING:
    from shared.text.pipeline import TextPipeline

router = APIRouter(prefix="/v1/texts", tags=["texts"], responses=RESPONSES)

MAX_PROMPTS = 64
"""Of one request: a second of work; more belong into a job."""
_loading = threading.Lock()


class ParseBody(BaseModel):
    """Prompts to parse."""

    model_config = ConfigDict(extra="forbid")

    prompts: list[str] = Field(min_length=1, max_length=MAX_PROMPTS)
    model: str = Field("hgm3", pattern=rf"^{MODEL.pattern}$", description="Model or bundle whose labeller to use.")


class NodeView(BaseModel):
    """A node: the motion, an action, or a specific of one."""

    id: int
    level: str
    text: str
    words: list[int]


class EdgeView(BaseModel):
    """A labelled edge."""

    model_config = ConfigDict(populate_by_name=True)

    source: int = Field(alias="from")
    target: int = Field(alias="to")
    type: str
    role: str


class GraphView(BaseModel):
    """The semantic graph of a prompt."""

    prompt: str
    """The prompt as it was checked and stored."""
    text: str
    """What the model reads: the prompt, or the prompt rewritten."""
    rewrite_reason: str | None
    """Why `text` differs from `prompt`, or why a rewrite was not used."""
    warnings: list[str]
    """What the author should know: no action found, or parts over the model's limits."""
    words: list[str]
    nodes: list[NodeView]
    edges: list[EdgeView]
    cut: dict[str, Any]


class GraphsView(BaseModel):
    """A graph a prompt, in the order given."""

    items: list[GraphView]


@router.post("/parse")
def parse_texts(body: ParseBody, key: Parser) -> GraphsView:
    """The semantic graph of each prompt."""
    prompts = [check_prompt(prompt, where=f"prompts.{index}") for index, prompt in enumerate(body.prompts)]
    parsed = pipeline_of(body.model).explain(prompts)
    return GraphsView(items=[GraphView.model_validate(each.to_json()) for each in parsed])


def pipeline_of(model: str) -> TextPipeline:
    """What reads prompts for a model or bundle.

    Raises:
        InvalidInput: it reads none.
        NotFound, InvalidBundle: as `choose_bundle` and `TextPipeline.load`.
        Unreachable: this server was installed without what parsing needs.
    """
    with named_by("model"):
        bundle = choose_bundle(model, verify=False)
    if bundle.manifest.text is None:
        raise InvalidInput(f"{model!r} does not read prompts", where="model", hint="Name a generator.")
    with _loading:
        return _loaded(as_served(bundle.manifest.text).model_dump_json())


@lru_cache(maxsize=4)
def _loaded(spec: str) -> TextPipeline:
    try:
        import torch  # noqa: F401  # not before somebody asks
    except ImportError as error:
        raise Unreachable(
            "this server cannot parse texts: torch is not installed beside it", hint="Install marey[worker] there."
        ) from error
    from shared.text.pipeline import TextPipeline

    return TextPipeline.load(TextSpec.model_validate_json(spec))
