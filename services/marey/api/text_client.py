"""The API's client of the text service."""

from __future__ import annotations

import asyncio
import json
import re
import ssl
from collections.abc import Mapping, Sequence
from typing import Any

import httpx2
import structlog
from anyio import to_thread
from pydantic import BaseModel, ValidationError
from starlette.responses import Response

from marey.core import tracing
from marey.core.errors import InvalidInput, MareyError, Unreachable
from marey.core.settings import Settings
from marey.http.problems import MEDIA_TYPE, RETRY_AFTER, ProblemBody
from marey.text_service.limits import WordLimit
from marey.text_service.routes import GraphsView, ParseBody, ScopesView, too_late
from marey.vocabulary.scope import Scope, read_scope

CONNECT_SECONDS = 2.0
SOCKET = "unix://"
PATH = "/v1/texts/parse"
SCOPE_PATH = "/v1/texts/scope"
JSON = "application/json"
MAX_ANSWER = 8 * 2**20
"""Bytes. The graphs of 64 prompts of maximum length take one of them."""
RETRY = re.compile(r"[0-9]{1,5}")
PASSED_ON = (200, 404, 413, 422, 429, 503)
"""Statuses caused by the caller; others are faults of the server."""

log = structlog.get_logger(__name__)


class TextService:
    """Forwards prompts to the text service over HTTP; on the event loop, no thread waits.

    Raises:
        InvalidInput: a URL is configured without the secret.
    """

    def __init__(self, config: Settings) -> None:
        self._seconds = config.text_seconds
        self._limit = WordLimit()
        self._http = None if config.text_url is None else _client(config, config.text_url)

    async def parse(self, body: ParseBody) -> Response:
        """Return the graphs of prompts, or the problem that the text service answers.

        Raises:
            Busy, Unreachable: as `_post`.
        """
        return await self._post(PATH, body, GraphsView)

    async def scopes(self, prompts: Mapping[str, Sequence[str]]) -> Mapping[tuple[str, str], Scope]:
        """Return the encoder's verdicts on prompts, by bundle and prompt; none for a bundle that cannot be judged now.

        Args:
            prompts: those of each bundle, by its name; at most `MAX_PROMPTS` each.
        """
        found: dict[tuple[str, str], Scope] = {}
        for bundle, texts in prompts.items():
            try:
                answer = await self._post(SCOPE_PATH, ParseBody(prompts=list(texts), model=bundle), ScopesView)
            except MareyError as error:
                log.info("scope_by_words", bundle=bundle, reason=error.message)
                continue
            if answer.status_code == 200:
                records = ScopesView.model_validate_json(bytes(answer.body)).items
                found.update(_verdicts(bundle, texts, records))
        return found

    async def _post(self, path: str, body: ParseBody, view: type[BaseModel]) -> Response:
        """Return the answer of the text service, or its problem.

        Raises:
            Busy: too much is being parsed.
            Unreachable: no answer in time, or no text service.
        """
        if self._http is None:
            raise Unreachable(
                "there is no text service",
                where="MAREY_TEXT_URL",
                hint="Start `marey text serve` and set MAREY_TEXT_URL to its address.",
                public="this server does not parse texts",
            )
        headers = {"Content-Type": JSON, "Accept-Encoding": "identity"}
        if (trace := tracing.current()) is not None:
            headers[tracing.HEADER] = trace
        with self._limit.take(body.prompts):
            try:
                async with (
                    asyncio.timeout(self._seconds),
                    self._http.stream("POST", path, content=json.dumps(body.model_dump()), headers=headers) as answer,
                ):
                    return await _passed_on(answer, view)
            except TimeoutError:
                raise too_late(self._seconds) from None
            except httpx2.HTTPError as error:
                raise _away(f"{type(error).__name__}: {error}") from error

    async def close(self) -> None:
        """Close the connections."""
        if self._http is not None:
            await self._http.aclose()


def _verdicts(
    bundle: str, prompts: Sequence[str], records: Sequence[Mapping[str, Any]]
) -> Mapping[tuple[str, str], Scope]:
    """Return the scopes of prompts from the records of an answer; none if they are not those of these prompts."""
    try:
        return {(bundle, prompt): read_scope(record) for prompt, record in zip(prompts, records, strict=True)}
    except (KeyError, TypeError, ValueError) as error:
        log.warning("scope_by_words", bundle=bundle, reason=f"the text service answered no scopes: {error}")
        return {}


def _client(config: Settings, url: str) -> httpx2.AsyncClient:
    if config.text_key is None:
        raise InvalidInput(
            "the text service is configured without its secret",
            where="MAREY_TEXT_KEY",
            hint="Set it to the secret of the text service.",
        )
    path = url.removeprefix(SOCKET) if url.startswith(SOCKET) else None
    # Trusting none costs nothing; reading the machine's certificate authorities takes as long as many imports.
    trust = True if url.startswith("https") else ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    return httpx2.AsyncClient(
        base_url=url if path is None else "http://text",
        headers={"Authorization": f"Bearer {config.text_key.get_secret_value()}"},
        transport=httpx2.AsyncHTTPTransport(uds=path, verify=trust, trust_env=False),
        timeout=httpx2.Timeout(config.text_seconds, connect=CONNECT_SECONDS),
        trust_env=False,
    )


async def _passed_on(answer: httpx2.Response, wanted: type[BaseModel]) -> Response:
    """Return the answer if it is the text service's own; answers of other servers are not passed to clients.

    Raises:
        Unreachable: it is another server.
    """
    status = answer.status_code
    view, media_type = (wanted, JSON) if status == 200 else (ProblemBody, MEDIA_TYPE)
    if status not in PASSED_ON or answer.headers.get("Content-Type", "").partition(";")[0].strip() != media_type:
        raise _away(f"it answered {status}")
    content = bytearray()
    async for part in answer.aiter_raw():  # not decompressed: compression was not requested
        content += part
        if len(content) > MAX_ANSWER:
            raise _away(f"its answer is over {MAX_ANSWER:,} bytes")
    try:
        await to_thread.run_sync(view.model_validate_json, bytes(content))
    except ValidationError as error:
        raise _away(f"it answered {status} with something other than {view.__name__}") from error
    wait = answer.headers.get("Retry-After", "")
    headers = {"Retry-After": wait if RETRY.fullmatch(wait) else RETRY_AFTER} if status >= 429 else {}
    return Response(bytes(content), status, headers, media_type)


def _away(why: str) -> Unreachable:
    return Unreachable(
        f"the text service does not answer ({why})",
        where="MAREY_TEXT_URL",
        hint="Does `marey text serve` run there, with the same MAREY_TEXT_KEY?",
        public="the text service does not answer",
    )
