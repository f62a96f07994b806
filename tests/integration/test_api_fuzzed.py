"""Whatever the OpenAPI document allows, and much that it does not, is answered without a 500: by the same words to
everybody whose key does not open the route, and to the others with the name of the field that is wrong."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any
from uuid import UUID

import pytest
import requests
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from schemathesis.checks import not_a_server_error
from schemathesis.generation import GenerationMode
from schemathesis.generation.hypothesis.builder import HypothesisTestConfig, HypothesisTestMode, create_test
from schemathesis.specs.openapi.checks import response_schema_conformance

from marey.db import transaction
from marey.embedded import EmbeddedServer
from marey.tenants import create_key, create_tenant
from tests.support.auth_states import Knock, invalid_knocks, lesser_knocks
from tests.support.document import openapi
from tests.support.live_api import LiveApi, running_api, settings_of
from tests.support.live_streams import add_streamer
from tests.support.named_fields import names_the_field

EXAMPLES = 6
"""Of each operation, beside those that cover its document value by value, wrong ones too; `slow` runs many more."""
CHECKS = [not_a_server_error, response_schema_conformance, names_the_field]
PROMPT = "a secretive person waltzes"
ENDS = {"DELETE", "POST /v1/jobs/{job}/erase"}
"""Methods and operations that are tried on things that are nowhere: the others want something to find."""


def direct_session() -> requests.Session:
    """Return a session that reads no proxies from the environment, which takes as long as some of the requests."""
    session = requests.Session()
    session.trust_env = False
    return session


@dataclass
class Place:
    """A server, what a tenant has on it, and keys without access to it."""

    api: LiveApi
    ids: dict[str, str]
    """Of what there is, by the names that paths give them."""
    invalid: list[Knock]
    lesser: dict[str, list[Knock]]
    """By the scope that is wanted."""
    rival: str
    """The secret of a key of another tenant."""
    session: requests.Session = field(default_factory=direct_session)
    turns: Counter[str] = field(default_factory=Counter)
    """How many knocks each operation has had."""

    @property
    def owner(self) -> dict[str, str]:
        """Headers with all scopes."""
        return {"Authorization": f"Bearer {self.api.key}"}

    def knock(self, case: schemathesis.Case, *, again: bool) -> Knock | None:
        """The next in turn for this operation; None, if it wants no key, or if all had their turn and not `again`."""
        wanted = case.operation.definition.raw.get("security")
        if not wanted:
            return None
        knocks = [*self.invalid, *self.lesser[wanted[0]["HTTPBearer"][0]]]
        turn = self.turns[case.operation.label]
        self.turns[case.operation.label] += 1
        return knocks[turn % len(knocks)] if again or turn < len(knocks) else None

    def send(self, case: schemathesis.Case, headers: dict[str, str]) -> requests.Response:
        request = requests.Request(**case.as_transport_kwargs(base_url=self.api.url)).prepare()
        request.headers.pop("Authorization", None)
        request.headers.update({"Accept": "application/json", **headers})
        return self.session.send(request, timeout=30, allow_redirects=False)


@pytest.fixture(scope="module")
def place(
    module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Place]:
    config = settings_of(tmp_path_factory.mktemp("api"), module_database_url, valkey.url)
    add_streamer(config)
    with running_api(config, module_database_url) as api:
        lesser = {scope: lesser_knocks(api.engine, scope) for scope in ("read", "submit", "operate", "metrics")}
        with transaction(api.engine) as conn:
            create_tenant(conn, "rival")
            rival = create_key(conn, "rival", ["admin"], tenant="rival").secret
            api.key = create_key(conn, "all", ["admin", "metrics"]).secret
        yield Place(api, things(api), invalid_knocks(api.engine), lesser, rival)


def things(api: LiveApi) -> dict[str, str]:
    """One of each that can be made without a worker, and a motion."""
    with api.http() as http:
        made = {
            noun: http.post(f"/v1/{noun}s", json=body).json()["id"]
            for noun, body in (
                ("job", {"items": [{"prompt": PROMPT}]}),
                ("stream", {"prompt": PROMPT}),
                ("webhook", {"url": "http://127.0.0.1:9/hook"}),
            )
        }
        api.work()
        made["motion"] = http.get(f"/v1/jobs/{made['job']}/motions").json()["items"][0]["id"]
        made["event"] = http.post(f"/v1/webhooks/{made['webhook']}/test").json()["event"]
    return made


@schemathesis.serializer("application/x-ndjson")
def ndjson(_context: object, value: object) -> bytes:
    """A body of one line; a list is a body of as many."""
    return b"".join(json.dumps(line).encode() + b"\n" for line in (value if isinstance(value, list) else [value]))


LOOKAHEAD, PLAIN = "^(?=.*[^ ])[^{0}]*$", "^[^{0}]*[^ {0}][^{0}]*$"
"""Two patterns of text that is not blank, for the same strings."""


def searchable() -> dict[str, Any]:
    """The OpenAPI document, its pattern of tags without a lookahead: schemathesis finds strings for that by trial."""
    found = openapi()
    tag = found["components"]["schemas"]["NewItemBody"]["properties"]["tags"]["items"]
    unwanted = tag["pattern"].removeprefix("^(?=.*[^ ])[^").removesuffix("]*$")
    assert tag["pattern"] == LOOKAHEAD.format(unwanted)
    tag["pattern"] = PLAIN.format(unwanted)
    return found


document = schemathesis.openapi.from_dict(searchable())
operations = document.exclude(path="/readyz")  # which answers 503 on purpose: no worker runs here
OPERATIONS = {found.ok().label: found.ok() for found in operations.get_all_operations()}
"""By their labels. Tests make their cases when they run: `parametrize()` makes them in every process that collects."""
QUICK = settings(
    max_examples=EXAMPLES,
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=list(HealthCheck),
)


def check(case: schemathesis.Case, place: Place, *, again: bool = False) -> None:
    """Send it with a key that does not open the route, with another tenant's, then with one that may do everything.

    Args:
        again: also when every key that does not open it was shown once.
    """
    if case.method.upper() != case.operation.method.upper():  # an operation that is not described, or another one
        case.validate_response(place.send(case, place.owner), checks=[not_a_server_error])
        return
    found = aim(case, place.ids)
    knock = place.knock(case, again=again)
    if knock is not None:
        refused(case, knock, place.send(case, knock.headers))
        if found:
            foreign(place.send(case, {"Authorization": f"Bearer {place.rival}"}))
    case.validate_response(place.send(case, place.owner), checks=CHECKS)


def aim(case: schemathesis.Case, ids: dict[str, str]) -> bool:
    """Put ids of what there is into a path with ids of nothing; whether that was done."""
    if {case.method.upper(), case.operation.label} & ENDS:
        return False
    path: dict[str, Any] = case.path_parameters or {}
    known = {name: ids[name] for name, value in path.items() if name in ids and is_id(value)}
    path.update(known)
    return bool(known)


def is_id(value: object) -> bool:
    try:
        UUID(str(value))
    except ValueError:
        return False
    return True


def refused(case: schemathesis.Case, knock: Knock, answer: requests.Response) -> None:
    """It says what is wrong with the key and nothing else, however wrong the rest of the request is: but for a path
    that leads nowhere, and a body that is no JSON."""
    problem = answer.json()
    nowhere = answer.status_code == 404 and problem["detail"] == "there is nothing at this path"
    unread = answer.status_code == 422 and problem["where"] == "body" and case.operation.body
    if not nowhere and not unread:
        knock.check(answer.status_code, problem)
    assert PROMPT not in answer.text


def foreign(answer: requests.Response) -> None:
    """Resources of another tenant do not exist."""
    assert answer.status_code in (404, 422), f"{answer.status_code} {answer.text[:300]}"
    assert PROMPT not in answer.text
    assert "paperclip" not in answer.text


@pytest.mark.parametrize("label", OPERATIONS)
def test_no_request_makes_the_server_fail(label: str, place: Place) -> None:
    def send(case: schemathesis.Case) -> None:
        check(case, place)

    config = HypothesisTestConfig(project=document.config, modes=list(HypothesisTestMode), settings=QUICK)
    create_test(operation=OPERATIONS[label], test_func=send, config=config)()


@pytest.mark.slow
@pytest.mark.parametrize("label", OPERATIONS)
def test_no_request_out_of_many_makes_the_server_fail(label: str, place: Place) -> None:
    operation = OPERATIONS[label]

    @given(st.one_of([operation.as_strategy(generation_mode=mode) for mode in GenerationMode]))
    @settings(QUICK, max_examples=300, derandomize=False)
    def send(case: schemathesis.Case) -> None:
        check(case, place, again=True)

    send()
