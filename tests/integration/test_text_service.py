"""The API and its text service: deadlines, limits and the secret between them. The labeller is not needed here."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import httpx2
import pytest
from pydantic import SecretStr

from marey.core.settings import Settings
from marey.db import create_engine, transaction
from marey.embedded import EmbeddedServer
from marey.tenants import create_key
from marey.text_service import routes
from marey.text_service.routes import GraphsView, ParseBody
from marey.text_service.server import create_text_app
from tests.servers.ports import free_ports
from tests.support.live_api import ApiThread, settings_of, with_text_service

PATH = "/v1/texts/parse"
BODY = {"prompts": ["a person walks"]}
SECONDS = 1.0


@pytest.fixture(scope="module")
def config(module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory) -> Settings:
    found = settings_of(tmp_path_factory.mktemp("texts"), module_database_url, valkey.url)
    return found.model_copy(update={"text_seconds": SECONDS})


@pytest.fixture(scope="module")
def key(module_database_url: str) -> str:
    engine = create_engine(module_database_url)
    with transaction(engine) as conn:
        made = create_key(conn, "reader", ["read"]).secret
    engine.dispose()
    return made


def client(url: str, key: str) -> httpx2.Client:
    return httpx2.Client(base_url=url, headers={"Authorization": f"Bearer {key}"}, timeout=30)


class LeasedText:
    """Stands for the labeller: requests wait in it until `go`."""

    def __init__(self) -> None:
        self.entered, self.go = threading.Semaphore(0), threading.Event()

    def __call__(self, body: ParseBody) -> GraphsView:
        self.entered.release()
        assert self.go.wait(30)
        return GraphsView(items=[])


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Iterator[LeasedText]:
    labeller = LeasedText()
    monkeypatch.setattr(routes, "parse_prompts", labeller)
    yield labeller
    labeller.go.set()


def test_too_much_at_once_is_429_and_everything_else_is_answered_meanwhile(
    config: Settings, key: str, held: LeasedText
) -> None:
    patient = config.model_copy(update={"text_seconds": 30.0})
    long = {"prompts": ["a person walks " * 60] * 16}
    with with_text_service(patient) as named, ApiThread(named) as url, client(url, key) as http:
        with ThreadPoolExecutor(60) as pool:
            asked = [pool.submit(http.post, PATH, json=long) for _ in range(45)]
            assert held.entered.acquire(timeout=20)
            refused = [answer.result() for answer in asked if _ends(answer)]
            assert refused
            assert {answer.status_code for answer in refused} == {429}
            assert all(int(answer.headers["Retry-After"]) >= 1 for answer in refused)
            assert http.get("/livez").status_code == 200
            assert http.get("/v1/jobs").status_code == 200
            held.go.set()
            assert {answer.result().status_code for answer in asked} == {200, 429}
        assert http.post(PATH, json=BODY).status_code == 200, "every share was given back"


def _ends(answer) -> bool:
    try:
        answer.result(timeout=1)
    except TimeoutError:
        return False
    return True


def test_what_is_not_parsed_in_time_is_503_and_holds_its_share_until_it_ends(
    config: Settings, key: str, held: LeasedText
) -> None:
    with with_text_service(config) as named, ApiThread(named) as url, client(url, key) as http:
        late = http.post(PATH, json=BODY)
        assert late.status_code == 503
        assert late.headers["Retry-After"]
        assert late.json()["where"] == "prompts"
        held.go.set()
        assert http.post(PATH, json=BODY).status_code == 200


def test_a_text_service_that_is_away_is_503_and_its_place_is_told_to_nobody(config: Settings, key: str) -> None:
    port = free_ports(1)[0]
    update = {"text_url": f"http://127.0.0.1:{port}", "text_key": SecretStr("secret")}
    with ApiThread(config.model_copy(update=update)) as url, client(url, key) as http:
        away = http.post(PATH, json=BODY)
        assert (away.status_code, away.json()["detail"]) == (503, "the text service does not answer")
        assert str(port) not in away.text
        assert "127.0.0.1" not in away.text
        assert http.post(PATH, json={"prompts": []}).status_code == 422, "checked before it is forwarded"


def test_an_api_without_a_text_service_says_so(config: Settings, key: str) -> None:
    with ApiThread(config) as url, client(url, key) as http:
        answer = http.post(PATH, json=BODY)
    assert (answer.status_code, answer.json()["detail"]) == (503, "this server does not parse texts")


def test_the_secret_is_wanted_by_the_service_and_checked_by_the_api(
    config: Settings, key: str, held: LeasedText
) -> None:
    held.go.set()
    port = free_ports(1)[0]
    update = {"text_url": f"http://127.0.0.1:{port}", "text_key": SecretStr("right")}
    service = config.model_copy(update={**update, "port": port})
    wrong = config.model_copy(update={**update, "text_key": SecretStr("wrong")})
    with ApiThread(service, create_text_app(service, preload=False)) as direct, ApiThread(wrong) as url:
        for headers in ({}, {"Authorization": "Bearer wrong"}, {"Authorization": "Basic right"}):
            answer = httpx2.post(f"{direct}{PATH}", json=BODY, headers=headers)
            assert answer.status_code == 401
        assert httpx2.post(f"{direct}{PATH}", json=BODY, headers={"Authorization": "Bearer right"}).status_code == 200
        with client(url, key) as http:
            answer = http.post(PATH, json=BODY)
        assert (answer.status_code, answer.json()["detail"]) == (503, "the text service does not answer")
