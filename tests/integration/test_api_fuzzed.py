"""Whatever the OpenAPI document allows, and much that it does not, is answered without a 500."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, settings
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import response_schema_conformance

from services.api.app import create_app, openapi
from shared.jobs import create_engine, create_key, transaction
from shared.runtime.embedded import EmbeddedServer
from shared.settings import Settings
from shared.storage import open_store
from tests.support.live_api import ApiThread, LiveApi, settings_of
from tests.support.live_streams import add_mogo

EXAMPLES = 12
"""Of each operation; `slow` runs many more."""


@pytest.fixture(scope="module")
def api(
    module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[LiveApi]:
    config = settings_of(tmp_path_factory.mktemp("api"), module_database_url, valkey.url)
    add_mogo(config)
    engine = create_engine(module_database_url)
    with transaction(engine) as conn:
        key = create_key(conn, "all", ["admin"]).secret
    with ApiThread(config) as url:
        live = LiveApi(url, key, engine, open_store(config))
        with live.client() as client:  # something to find
            client.submit([{"prompt": "a person walks"}])
        live.work()
        yield live
    engine.dispose()


@schemathesis.serializer("application/x-ndjson")
def ndjson(_context: object, value: object) -> bytes:
    """A body of one line; a list is a body of as many."""
    return b"".join(json.dumps(line).encode() + b"\n" for line in (value if isinstance(value, list) else [value]))


document = schemathesis.openapi.from_dict(openapi(create_app(Settings())))
# A stream does not end, and `readyz` answers 503 on purpose: no worker runs here.
operations = document.exclude(path_regex="/events$").exclude(path="/readyz")
QUICK = settings(
    max_examples=EXAMPLES,
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=list(HealthCheck),
)


def check(case: schemathesis.Case, api: LiveApi) -> None:
    headers = {"Authorization": f"Bearer {api.key}"}
    checks = [not_a_server_error, response_schema_conformance]
    case.call_and_validate(base_url=api.url, headers=headers, checks=checks, timeout=30)


@operations.parametrize()
@QUICK
def test_no_request_makes_the_server_fail(case: schemathesis.Case, api: LiveApi) -> None:
    check(case, api)


@pytest.mark.slow
@operations.parametrize()
@settings(QUICK, max_examples=300, derandomize=False)
def test_no_request_out_of_many_makes_the_server_fail(case: schemathesis.Case, api: LiveApi) -> None:
    check(case, api)
