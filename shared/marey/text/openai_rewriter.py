"""Rewriters `openai` and `tca`: a language model brings prompts into the wording of training texts (`text.wordings`).

Any endpoint with OpenAI's `POST /chat/completions` works, including a local one. A failure never costs a motion: if the
endpoint is slow, unreachable or returns an unusable answer, the prompt is used as written and the reason is recorded.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import httpx2
from pydantic import SecretStr

from marey.core.errors import InvalidInput
from marey.core.settings import Settings
from marey.core.tls import trusting_context
from marey.text.rewriters import NotRewritten, Rewrite
from marey.text.wordings import Question

log = logging.getLogger(__name__)

MAX_ANSWER_BYTES = 64 * 2**10
TRIES = 3
RETRIED = frozenset({408, 429, 500, 502, 503, 504})
CACHED = 4096
AT_ONCE = 8
"""Calls of one process at the same time."""
REST_AFTER, REST_SECONDS = 3, 30.0
"""Circuit breaker: after this many failed prompts in a row, skip the endpoint for this many seconds."""


@dataclass(frozen=True)
class Endpoint:
    """Address and credentials of the language model.

    Attributes:
        url: up to and without `/chat/completions`.
        seconds: for one prompt, with all tries.
        ca_file: PEM file of certificate authorities to trust beside the machine's own.
    """

    url: str
    model: str
    key: SecretStr | None = None
    seconds: float = 10.0
    ca_file: Path | None = None

    @classmethod
    def of(cls, config: Settings) -> Endpoint:
        """Read the endpoint from the settings.

        Raises:
            InvalidInput: no model.
        """
        if not config.rewriter_model:
            raise InvalidInput("no language model is named", where="MAREY_REWRITER_MODEL", hint="Name one of yours.")
        url = config.rewriter_url.rstrip("/")
        return cls(url, config.rewriter_model, config.rewriter_key, config.rewriter_seconds, config.ca_file)


class OpenAIRewriter:
    """Rewrites prompts by a language model; answers are cached, so that a process asks once per prompt. Thread-safe."""

    def __init__(self, endpoint: Endpoint, question: Question, name: str = "openai") -> None:
        self.name = name
        self._endpoint = endpoint
        self._question = question
        secret = {} if endpoint.key is None else {"Authorization": f"Bearer {endpoint.key.get_secret_value()}"}
        self._client = httpx2.Client(
            headers=secret,
            timeout=endpoint.seconds,
            follow_redirects=False,
            verify=trusting_context(endpoint.ca_file),
        )
        self._lock = threading.Lock()
        self._answers: OrderedDict[str, Rewrite] = OrderedDict()
        self._failed_ahead: dict[str, NotRewritten] = {}
        self._failures = 0
        self._rests_until = 0.0

    def rewrite(self, prompt: str) -> Rewrite:
        """A prompt in the words of the language model.

        Raises:
            NotRewritten: no answer in time, or none that can be a prompt.
        """
        with self._lock:
            if prompt in self._answers:
                self._answers.move_to_end(prompt)
                return self._answers[prompt]
            if prompt in self._failed_ahead:
                raise self._failed_ahead.pop(prompt)
            if time.monotonic() < self._rests_until:
                raise NotRewritten("the language model did not answer lately and is left alone for a while")
        try:
            answer = self._ask(prompt)
        except NotRewritten:
            self._failed()
            raise
        rewrite = self._question.read(answer)
        with self._lock:
            self._failures = 0
            self._answers[prompt] = rewrite
            while len(self._answers) > CACHED:
                self._answers.popitem(last=False)
        return rewrite

    def prefetch(self, prompts: Sequence[str]) -> None:
        """Request several prompts at once; `rewrite` then returns their answers and raises their errors. Those whose
        error waits to be raised are not asked again."""
        failed = {prompt: self._failed_ahead[prompt] for prompt in prompts if prompt in self._failed_ahead}
        self._failed_ahead = {}

        def ask(prompt: str) -> tuple[str, NotRewritten | None]:
            try:
                self.rewrite(prompt)
            except NotRewritten as error:
                return prompt, error
            return prompt, None

        with ThreadPoolExecutor(AT_ONCE) as pool:
            asked = failed | dict(pool.map(ask, (prompt for prompt in dict.fromkeys(prompts) if prompt not in failed)))
        self._failed_ahead = {prompt: error for prompt, error in asked.items() if error is not None}

    def _ask(self, prompt: str) -> str:
        """The answer's text, after as many tries as the time allows."""
        ends = time.monotonic() + self._endpoint.seconds
        reason = "there was no time left"
        for attempt in range(TRIES):
            pause = 0.0
            try:
                status, body, pause = self._post(prompt, ends - time.monotonic())
                if status == 200:
                    return _content(body)
                reason = f"the language model answered with status {status}"
                if status not in RETRIED:
                    break
            except httpx2.TimeoutException:
                reason = f"the language model did not answer within {self._endpoint.seconds:g} s"
            except httpx2.HTTPError as error:
                reason = f"the language model cannot be reached: {type(error).__name__}"
            pause = max(pause, 0.25 * 2**attempt)
            if time.monotonic() + pause >= ends:
                break
            time.sleep(pause)
        raise NotRewritten(reason)

    def _post(self, prompt: str, seconds: float) -> tuple[int, bytes, float]:
        """Status, body and the seconds that a `Retry-After` asks for."""
        question = {
            "model": self._endpoint.model,
            "messages": [
                {"role": "system", "content": self._question.instruction},
                {"role": "user", "content": prompt},
            ],
            "temperature": 0,
        }
        url = f"{self._endpoint.url}/chat/completions"
        ends = time.monotonic() + seconds
        with self._client.stream("POST", url, json=question, timeout=max(seconds, 0.01)) as response:
            body = b""
            for part in response.iter_bytes():
                body += part
                if len(body) > MAX_ANSWER_BYTES:
                    raise NotRewritten("the language model's answer is too long")
                if time.monotonic() > ends:  # the client's own time limit is for each read
                    raise NotRewritten(f"the language model did not answer within {self._endpoint.seconds:g} s")
            after = response.headers.get("Retry-After", "")
            return response.status_code, body, float(after) if after.isdecimal() else 0.0

    def _failed(self) -> None:
        with self._lock:
            self._failures += 1
            if self._failures >= REST_AFTER:
                self._failures, self._rests_until = 0, time.monotonic() + REST_SECONDS
                log.warning("the language model of the rewriter is left alone for %g s", REST_SECONDS)


def _content(body: bytes) -> str:
    """The text of a chat completion. Raises NotRewritten."""
    try:
        content = json.loads(body)["choices"][0]["message"]["content"]
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise NotRewritten("the language model's answer is not a chat completion") from error
    if not isinstance(content, str):
        raise NotRewritten("the language model's answer holds no text")
    return content
