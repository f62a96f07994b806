"""The clients of a chaos run: studios that submit through the API until each job is accepted once, and an operator."""

from __future__ import annotations

import json
import math
import random
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from uuid import uuid4

import httpx2

from marey.jobs.states import ENDED
from tests.chaos.model import FILE_BYTES

BROKEN = ("refuse", "once", "bug", "bad-export", "refused-export")
"""Prompts that go wrong alone: one in fifty."""
VERBS = ("pause", "resume", "cancel", "retry", "retry failed", "priority", "comment")
WEIGHTS = (3.0, 5.0, 0.3, 2.0, 4.0, 3.0, 1.0)
AWAY = {408, 503}
"""Answers that ask for patience: too slow, or something is away."""
PAUSE = 0.3  # seconds before a submit is tried again
FIRST = 4
"""Items of a studio's first job."""


@dataclass(frozen=True)
class Quota:
    """Of a tenant of the run; None = none."""

    queued: int | None = None
    running: int | None = None
    files: int | None = None
    """Motions' worth of bytes."""

    def values(self) -> dict[str, int | None]:
        """As the product takes them; two files a motion."""
        size = None if self.files is None else self.files * 2 * FILE_BYTES
        return {"queued": self.queued, "running": self.running, "bytes": size}


@dataclass(eq=False)
class Studio(threading.Thread):
    """Submits jobs of one tenant until `items` items were accepted.

    Attributes:
        accepted: items of each job that was answered with 202.
        refused: answers 429, by what was used up.
        asked_again: submits that were repeated because no answer came, or one that something was away.
        odd: answers that say neither.
    """

    url: str
    key: str
    tenant: str
    items: int
    toxic: Sequence[str]
    """Prompts among them that bring down their worker, or hang."""
    seed: int
    job_sizes: tuple[int, int]
    stop: threading.Event
    accepted: dict[str, int] = field(default_factory=dict)
    refused: Counter[str] = field(default_factory=Counter)
    asked_again: int = 0
    odd: list[str] = field(default_factory=list)
    error: BaseException | None = None

    def __post_init__(self) -> None:
        super().__init__(name=f"studio-{self.tenant}", daemon=True)
        self._draw = random.Random(f"{self.seed} {self.tenant}")

    def run(self) -> None:
        try:
            with client_of(self.url, self.key) as http:
                self._begin(http)
                for number, prompts in enumerate(self._jobs()):
                    self._submit(http, number, prompts)
        except BaseException as error:
            self.error = error

    def _begin(self, http: httpx2.Client) -> None:
        """A first job, waited for: what a motion takes of a quota of bytes is known from then on."""
        self._submit(http, 0, [f"walk {n}" for n in range(FIRST)])
        while not self.stop.is_set():
            answer = ask(http, "GET", f"/v1/jobs/{next(iter(self.accepted))}")
            if answer is not None and answer.status_code == 200 and answer.json()["state"] in ENDED:
                return
            time.sleep(PAUSE)

    def _jobs(self) -> list[list[str]]:
        """Prompts of each job: toxic and broken ones among harmless ones, some said twice."""
        count = self.items - FIRST
        left = [f"walk {self._draw.randrange(self.items)}" for _ in range(count)]
        odd = [*self.toxic, *(self._draw.choice(BROKEN) for _ in range(math.ceil(count / 50)))]
        for place, deed in zip(self._draw.sample(range(count), len(odd)), odd, strict=True):
            left[place] = f"{deed} {place}"
        jobs: list[list[str]] = []
        while left:
            size = self._draw.randint(*self.job_sizes)
            jobs.append(left[:size])
            del left[:size]
        return jobs

    def _submit(self, http: httpx2.Client, number: int, prompts: Sequence[str]) -> None:
        """One key for all tries of a submit: whatever happens to an answer, there is one job."""
        body = "\n".join(json.dumps({"prompt": prompt}) for prompt in prompts)
        headers = {"content-type": "application/x-ndjson", "idempotency-key": str(uuid4())}
        fail_early = {"fail_early": 0.5} if number % 7 == 3 else {}
        params = {"name": f"{self.tenant} {number}", "priority": number % 3, **fail_early}
        while not self.stop.is_set():
            answer = ask(http, "POST", "/v1/jobs", content=body, headers=headers, params=params)
            if answer is not None and answer.status_code == 202:
                job = answer.json()
                self.accepted[job["id"]] = len(prompts)
                return
            if answer is not None and answer.status_code == 429:
                quota = answer.json()["quota"]["name"]
                self.refused[quota] += 1
                if quota == "bytes":
                    return  # nothing will make room for it
            else:
                self.asked_again += 1
                if answer is not None and answer.status_code not in AWAY:
                    self.odd.append(f"submit: {answer.status_code} {answer.text}")
            time.sleep(PAUSE)


class Operator(threading.Thread):
    """Does seeded verbs to random jobs until told to end; then lets everything run that is paused.

    Attributes:
        answers: how many, by verb and status; 0 = none came.
        odd: answers that neither did it, nor refused it, nor said that something is away.
    """

    def __init__(self, studios: Sequence[Studio], seed: int, stop: threading.Event, pause: float) -> None:
        super().__init__(name="operator", daemon=True)
        self._studios = studios
        self._draw = random.Random(f"{seed} operator")
        self._done = stop
        self._pause = pause
        self.answers: Counter[tuple[str, int]] = Counter()
        self.odd: list[str] = []
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            while not self._done.wait(self._draw.uniform(0.5, 1.5) * self._pause):
                studio = self._draw.choice(self._studios)
                jobs = list(studio.accepted)[1:]  # bytes are estimated from the first
                if jobs:
                    self._do(studio, self._draw.choices(VERBS, WEIGHTS)[0], self._draw.choice(jobs[-10:]))
        except BaseException as error:
            self.error = error

    def release(self) -> None:
        """Resume what is paused, asking until it is so."""
        for studio in self._studios:
            with client_of(studio.url, studio.key) as http:
                for job in studio.accepted:
                    while True:
                        answer = ask(http, "POST", f"/v1/jobs/{job}/resume")
                        if answer is not None and answer.status_code in (200, 409):  # 409: it has ended
                            break
                        time.sleep(PAUSE)

    def _do(self, studio: Studio, verb: str, job: str) -> None:
        path, reason = f"/v1/jobs/{job}", {"reason": "chaos"}
        with client_of(studio.url, studio.key) as http:
            match verb:
                case "priority":
                    answer = ask(http, "PATCH", path, json={"priority": self._draw.randint(-5, 5)})
                case "comment":
                    answer = ask(http, "PATCH", path, json={"comment": "seen"})
                case "retry failed":
                    answer = ask(http, "POST", f"{path}/retry", params={**reason, "failed_only": "true"})
                case _:
                    answer = ask(http, "POST", f"{path}/{verb}", params=reason)
        status = 0 if answer is None else answer.status_code
        self.answers[verb, status] += 1
        if answer is not None and status not in {200, 409, 429, *AWAY}:
            self.odd.append(f"{verb}: {status} {answer.text}")


def client_of(url: str, key: str) -> httpx2.Client:
    """A client of the API with this key."""
    return httpx2.Client(base_url=url, headers={"Authorization": f"Bearer {key}"}, timeout=30.0)


def ask(http: httpx2.Client, method: str, path: str, **request: object) -> httpx2.Response | None:
    """One try; None where no answer came."""
    try:
        return http.request(method, path, **request)  # pyright: ignore[reportArgumentType]
    except httpx2.TransportError:
        return None
