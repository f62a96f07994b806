"""Routes of the text service, `POST /v1/texts/parse` and `/scope`, and the bodies that it shares with the API."""

from __future__ import annotations

import hmac
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, Generic, TypeVar

import anyio
from anyio import CapacityLimiter, to_thread
from fastapi import APIRouter, Depends, Request
from pydantic import BaseModel, ConfigDict, Field

from marey.bundles import TextSpec, choose_bundle, named_by
from marey.bundles.scope import judges_meaning
from marey.core import defaults
from marey.core.errors import InvalidInput, Unauthenticated, Unreachable
from marey.core.settings import Settings
from marey.http.fields import PROMPT
from marey.http.problems import RESPONSES
from marey.items.prompts import check_prompt
from marey.items.values import MODEL_PATTERN
from marey.text.keys import as_served
from marey.text_service.limits import Ticket, WordLimit
from marey.vocabulary.scope import match_scope

if TYPE_CHECKING:
    from marey.text.meaning import MeaningJudge
    from marey.text.pipeline import TextPipeline

View = TypeVar("View", bound=BaseModel)

MAX_PROMPTS = 64
"""Prompts of one request: a second of work; more belong in a job."""
THREADS = 4
"""Concurrent requests: torch serves one after the other, but a request may wait for a rewriter."""
MAX_LOADED = 4
"""Cached pipelines: bundles of one text specification share one."""
_loading = threading.RLock()
_loaded: dict[str, TextPipeline] = {}
_judges: dict[TextSpec, MeaningJudge] = {}


class ParseBody(BaseModel):
    """Prompts to parse."""

    model_config = ConfigDict(extra="forbid")

    prompts: list[Annotated[str, Field(json_schema_extra=PROMPT)]] = Field(min_length=1, max_length=MAX_PROMPTS)
    model: str = Field(defaults.MODEL, pattern=MODEL_PATTERN, description="Model or bundle whose labeller to use.")


class ScopesView(BaseModel):
    """One scope per prompt, in the order given, as `Scope.as_json` writes it."""

    items: list[dict[str, Any]]


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
    """The validated and stored prompt."""
    text: str
    """The text that the model reads: the prompt, or its rewrite."""
    rewrite_reason: str | None
    """Reason why `text` differs from `prompt`, or why a rewrite was not used."""
    movements: list[str]
    """Texts of its movements in the order of time, if it asks for several; each is made as a motion of its own."""
    warnings: list[str]
    """Notes for the author: no action found, or parts over the model's limits."""
    words: list[str]
    nodes: list[NodeView]
    edges: list[EdgeView]
    cut: dict[str, Any]


class GraphsView(BaseModel):
    """One graph per prompt, in the order given."""

    items: list[GraphView]


def parse_prompts(body: ParseBody) -> GraphsView:
    """Parse each prompt into its semantic graph."""
    prompts = [check_prompt(prompt, where=f"prompts.{index}") for index, prompt in enumerate(body.prompts)]
    parsed = pipeline_of(body.model).explain(prompts)
    return GraphsView(items=[GraphView.model_validate(each.to_json()) for each in parsed])


def judge_prompts(body: ParseBody) -> ScopesView:
    """Judge each prompt by its words, and by its meaning where they leave it undecided.

    Raises:
        InvalidInput: the bundle lists no actions.
    """
    prompts = [check_prompt(prompt, where=f"prompts.{index}") for index, prompt in enumerate(body.prompts)]
    with named_by("model"):
        manifest = choose_bundle(body.model, verify=False).manifest
    lists = manifest.actions
    if lists is None or manifest.text is None:
        raise InvalidInput(f"{body.model!r} lists no actions", where="model", hint="Name a bundle that does.")
    judge = judge_of(manifest.text) if judges_meaning(manifest.text) else None
    scopes = [match_scope(prompt, lists) if judge is None else judge.judge(prompt, lists) for prompt in prompts]
    return ScopesView(items=[scope.as_json() for scope in scopes])


def text_router(config: Settings) -> APIRouter:
    """Return the route of the text service.

    Args:
        config: its `text_key` is the secret that a request must have.

    Raises:
        InvalidInput: the secret is not configured.
    """
    if config.text_key is None:
        raise InvalidInput(
            "the text service needs a secret that it shares with the API",
            where="MAREY_TEXT_KEY",
            hint="Set it for both, or use `marey serve`, which creates one.",
        )
    secret = config.text_key.get_secret_value().encode()
    runner = _TaskRunner(config.text_seconds)

    async def check(request: Request) -> None:
        scheme, _, shown = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() != "bearer" or not hmac.compare_digest(shown.strip().encode(), secret):
            raise Unauthenticated("the key of the text service is missing or wrong", hint="It is MAREY_TEXT_KEY.")

    router = APIRouter(prefix="/v1/texts", tags=["texts"], responses=RESPONSES, dependencies=[Depends(check)])

    @router.post("/parse")
    async def parse_texts(body: ParseBody) -> GraphsView:
        """Parse each prompt into its semantic graph."""
        return await runner.run(parse_prompts, body)

    @router.post("/scope")
    async def judge_scopes(body: ParseBody) -> ScopesView:
        """Judge which prompts name actions that a bundle knows."""
        return await runner.run(judge_prompts, body)

    return router


class _TaskRunner:
    """Runs requests in `THREADS` threads, each within `seconds`; those in flight share a limit of words."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._limit, self._threads = WordLimit(), CapacityLimiter(THREADS)

    async def run(self, function: Callable[[ParseBody], View], body: ParseBody) -> View:
        """Return what `function` makes of a body.

        Raises:
            Busy: with those in flight, it has too many words.
            Unreachable: it took too long.
        """
        work = _Task(function, body, self._limit.take(body.prompts))
        try:
            with anyio.fail_after(self._seconds):
                return await to_thread.run_sync(work, limiter=self._threads, abandon_on_cancel=True)
        except TimeoutError:
            raise too_late(self._seconds) from None
        finally:
            work.forget()


class _Task(Generic[View]):
    """One request in a thread. It counts as in flight until the thread is done, even after the client disconnected."""

    def __init__(self, function: Callable[[ParseBody], View], body: ParseBody, ticket: Ticket) -> None:
        self._function, self._body, self._ticket, self._started = function, body, ticket, False

    def __call__(self) -> View:
        self._started = True
        with self._ticket:
            return self._function(self._body)

    def forget(self) -> None:
        """Release its share if no thread has started it."""
        if not self._started:
            self._ticket.release()


def too_late(seconds: float) -> Unreachable:
    """Return the error of a request that took too long."""
    message = f"the prompts were not parsed within {seconds:g} s"
    return Unreachable(message, where="prompts", hint="Send fewer at a time.", public=message)


def pipeline_of(model: str) -> TextPipeline:
    """Return the text pipeline of a model or bundle.

    Raises:
        InvalidInput: it does not read prompts.
        NotFound, InvalidBundle: as `choose_bundle` and `TextPipeline.load`.
    """
    with named_by("model"):
        bundle = choose_bundle(model, verify=False)
    if bundle.manifest.text is None:
        raise InvalidInput(f"{model!r} does not read prompts", where="model", hint="Name a generator.")
    return load_pipeline(bundle.manifest.text)


def judge_of(spec: TextSpec) -> MeaningJudge:
    """Return the judge of prompts by the encoder of a text specification, created once per process."""
    from marey.text.meaning import MeaningJudge

    with _loading:
        if spec not in _judges:
            _judges[spec] = MeaningJudge.of(load_pipeline(spec))
        return _judges[spec]


def load_pipeline(spec: TextSpec) -> TextPipeline:
    """Return the pipeline of a bundle's text specification, loaded once per process."""
    from marey.text.pipeline import TextPipeline

    served = as_served(spec)
    name = served.model_dump_json()
    found = _loaded.get(name)
    if found is None:
        with _loading:
            if name not in _loaded:
                while len(_loaded) >= MAX_LOADED:
                    del _loaded[next(iter(_loaded))]
                _loaded[name] = TextPipeline.load(served)
            return _loaded[name]
    return found
