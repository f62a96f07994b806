"""Messages as receivers check them, secrets as the database keeps them, and when the next try comes."""

from __future__ import annotations

import json
import re
import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path
from uuid import UUID, uuid4

import pytest
from cryptography.fernet import Fernet
from pydantic import SecretStr
from standardwebhooks.webhooks import Webhook, WebhookVerificationError

from marey.core.errors import InvalidInput, Refused
from marey.core.settings import Settings
from marey.scheduler.sending import asked_to_wait
from marey.webhooks import DueDelivery
from marey.webhooks.deliveries import DELAYS, HOLD, delay_after
from marey.webhooks.message import headers_of, message_of
from marey.webhooks.vault import Vault, key_file, new_signing_secret

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "webhooks.md"
JOB = UUID(int=7)
AT = datetime(2026, 11, 22, 3, 0, tzinfo=UTC)
API = "https://marey.example"


def due(**data: object) -> DueDelivery:
    return DueDelivery(uuid4(), uuid4(), uuid4(), "job.ended", AT, data, "https://studio.example", [b""], 0)


def test_the_library_of_standard_webhooks_verifies_a_message_and_no_changed_one() -> None:
    secret, each = new_signing_secret(), due(job=str(JOB), state="succeeded")
    body = message_of(each, API)
    headers = dict(headers_of(each, body, [secret]))
    assert headers["webhook-id"] == str(each.event)
    assert Webhook(secret).verify(body, headers) == json.loads(body)
    for changed, told in (
        (body + b" ", headers),
        (body, {**headers, "webhook-id": str(uuid4())}),
        (body, {**headers, "webhook-timestamp": str(int(headers["webhook-timestamp"]) + 1)}),
        (body, dict(headers_of(each, body, [secret], datetime.now(UTC) - timedelta(minutes=6)))),
        (body, dict(headers_of(each, body, [new_signing_secret()]))),
    ):
        with pytest.raises(WebhookVerificationError):
            Webhook(secret).verify(changed, told)


def test_while_a_secret_is_rotated_receivers_that_know_either_take_a_message() -> None:
    new, old, each = new_signing_secret(), new_signing_secret(), due(job=str(JOB))
    body = message_of(each, API)
    headers = dict(headers_of(each, body, [new, old]))
    assert len(headers["webhook-signature"].split()) == 2
    for secret in (new, old):
        assert Webhook(secret).verify(body, headers) == json.loads(body)
    with pytest.raises(WebhookVerificationError):
        Webhook(new_signing_secret()).verify(body, headers)


@pytest.mark.parametrize(
    ("header", "seconds"),
    [
        (None, 0), ("120", 120), (" 7 ", 7), ("Sun, 22 Nov 2026 03:01:30 GMT", 90),
        ("Sun, 22 Nov 2026 02:59:00 GMT", 0),
        ("soon", 0), ("-5", 0), ("1.5", 0), ("", 0), ("²", 0), ("9" * 5000, 1e12 - 1),
        ("Mon, 1 Jan 99999999999999999999 00:00:00 GMT", 0),
    ],
)  # fmt: skip
def test_a_receiver_may_ask_for_a_wait_in_seconds_or_by_a_date(header: str | None, seconds: float) -> None:
    assert asked_to_wait(header, AT) == seconds


def test_a_message_says_what_happened_and_where_the_api_shows_it() -> None:
    each = due(job=str(JOB), state="succeeded", counters={"total": 2}, schedule=None)
    assert json.loads(message_of(each, API)) == {
        "type": "job.ended",
        "timestamp": "2026-11-22T03:00:00+00:00",
        "data": {
            "job": str(JOB),
            "state": "succeeded",
            "counters": {"total": 2},
            "schedule": None,
            "urls": {"job": f"{API}/v1/jobs/{JOB}"},
        },
    }


def test_the_address_of_the_api_is_the_public_one_if_it_is_named() -> None:
    assert Settings(host="::", port=81).api_url == "http://[::1]:81"
    assert Settings(host="0.0.0.0", port=81, public_url=f"{API}/").api_url == API
    assert Settings(host="0.0.0.0", port=81, public_url=API).local_url == "http://127.0.0.1:81"


def test_eight_tries_span_a_day_and_no_try_can_outlast_its_claim() -> None:
    assert len(DELAYS) + 1 == 8
    assert 23 * 3600 < sum(DELAYS) < 24 * 3600
    (told,) = (line for line in GUIDE.read_text(encoding="utf-8").splitlines() if "after the one before" in line)
    units = {"s": 1, "min": 60, "h": 3600}
    assert [float(n) * units[unit] for n, unit in re.findall(r"([\d.]+) (s|min|h)\b", told)] == list(DELAYS)
    for number, delay in enumerate(DELAYS, 1):
        drawn = [delay_after(number) for _ in range(200)]
        assert 0.9 * delay <= min(drawn) < 0.93 * delay
        assert 1.07 * delay < max(drawn) <= 1.1 * delay
    assert HOLD >= 60


def test_a_sealed_secret_opens_with_its_key_also_behind_a_newer_one() -> None:
    old, new = Fernet.generate_key().decode(), Fernet.generate_key().decode()
    sealed = Vault(old).encrypt("whsec_abc")
    assert b"whsec" not in sealed
    assert Vault(f"{new}\n{old}").decrypt(sealed) == "whsec_abc"
    assert Vault(new).decrypt(Vault(f"{new},{old}").encrypt("whsec_abc")) == "whsec_abc"
    with pytest.raises(InvalidInput, match=r"^MAREY_WEBHOOK_KEY: does not open") as refused:
        Vault(new).decrypt(sealed)
    assert "behind the new one" in (refused.value.hint or "")


def test_no_key_or_a_broken_one_names_the_setting() -> None:
    with pytest.raises(Refused, match="has no key") as refused:
        Vault.of(Settings(webhook_key=None))
    assert refused.value.where == "MAREY_WEBHOOK_KEY"
    assert refused.value.hint
    for broken in ("", "abc", Fernet.generate_key().decode()[:-4]):
        with pytest.raises(InvalidInput, match=r"^MAREY_WEBHOOK_KEY: is not a list of keys") as told:
            Vault.of(Settings(webhook_key=SecretStr(broken)))
        assert "openssl rand" in (told.value.hint or "")


def test_a_home_draws_its_key_once_for_its_owner_alone(tmp_path: Path) -> None:
    path = key_file(tmp_path)
    drawn = path.read_text()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert key_file(tmp_path).read_text() == drawn
    assert Vault(drawn).decrypt(Vault(drawn).encrypt("x")) == "x"
