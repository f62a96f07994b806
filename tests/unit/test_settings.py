"""Settings are checked where they are read: one error that names the variable, its value and what is allowed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from marey.core.errors import InvalidInput
from marey.core.settings import Settings, settings


@pytest.fixture(autouse=True)
def _fresh() -> Iterator[None]:
    settings.cache_clear()
    yield
    settings.cache_clear()


def refusal(monkeypatch: pytest.MonkeyPatch, **variables: str) -> InvalidInput:
    """The error for these variables, `port="x"` for `MAREY_PORT=x`."""
    for name, value in variables.items():
        monkeypatch.setenv(f"MAREY_{name.upper()}", value)
    with pytest.raises(InvalidInput) as refused:
        settings()
    assert refused.value.exit_code == 2
    return refused.value


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("port", "abc", "of 1 to 65535"),
        ("port", "99999", "of 1 to 65535"),
        ("metrics_port", "0", "of 1 to 65535"),
        ("rewriter", "silly", "one of none, rules, openai"),
        ("require_licence", "free", "one of any, commercial"),
        ("log_level", "silly", "one of DEBUG, INFO, WARNING, ERROR, CRITICAL"),
        ("log_json", "perhaps", "true or false"),
        ("lease_seconds", "-1", "over 0"),
        ("sweep_seconds", "inf", "at most"),
        ("relay_seconds", "nan", "over 0"),
        ("max_attempts", "0", "of 1 to"),
        ("threads", "-1", "of 0 to"),
        ("device", "gpu", "auto, cpu, cuda or cuda:N"),
        ("allowed_hosts", "localhost", 'as ["one", "two"]'),
        ("webhook_allow", '["nowhere"]', '["public", "10.1.0.0/16"]'),
        ("cors_origins", '["*"]', "Name each exactly"),
        ("cors_origins", '["null"]', "Name each exactly"),
        ("cors_origins", '["https://app.example.com/path"]', "without a path"),
        ("cors_origins", '["app.example.com"]', "https://app.example.com"),
        ("rates", '{"read": "often"}', "600/minute"),
        ("rates", '{"write": "1/minute"}', "read, submit, operate, parse"),
        ("rates", "often", "an object in JSON"),
        ("public_url", "marey.example.com", "https://marey.example.com"),
        ("rewriter_url", "file:///etc", "https://"),
        ("s3_endpoint", "ftp://objects", "without a path"),
        ("s3_endpoint", "http://objects:9000/bucket", "without a path"),
        ("s3_public_endpoint", "https://user:password@objects", "without a path"),
    ],
    ids=lambda given: given.replace("/", " ")[:30],
)
def test_a_wrong_setting_is_told_with_its_variable_its_value_and_what_is_allowed(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str, allowed: str
) -> None:
    refused = refusal(monkeypatch, **{name: value})
    assert refused.where == f"MAREY_{name.upper()}"
    assert value in refused.message
    assert allowed in (refused.hint or "")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("database_url", "foo-secret"),
        ("database_url", "mysql://marey:secret@here/marey"),
        ("database_url", "postgresql://marey:secret@here:port/marey"),
        ("queue_url", "http://:secret@here"),
        ("streams_url", "secret"),
    ],
    ids=lambda given: given.replace("/", " ")[:30],
)
def test_the_value_of_a_secret_is_not_told(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    refused = refusal(monkeypatch, **{name: value})
    assert refused.where == f"MAREY_{name.upper()}"
    assert "secret" not in str(refused)
    assert refused.hint is not None
    assert refused.hint.startswith("Write ")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("database_url", "postgresql+psycopg://marey@/marey?host=/run/a:b"),
        ("database_url", "postgresql://marey:p/a:ss@db.example.com:5432/marey"),
        ("database_url", "postgresql+psycopg://marey@[::1]:5432/marey"),
        ("queue_url", "redis+socket:///run/marey.sock"),
        ("queue_url", "rediss://:pass@here:6379/0"),
        ("log_level", "debug"),
        ("device", "cuda:1"),
        ("webhook_allow", '["public", "10.1.0.0/16"]'),
        ("port", ""),
    ],
    ids=lambda given: given.replace("/", " ")[:30],
)
def test_what_can_be_used_is_taken_and_empty_counts_as_unset(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    monkeypatch.setenv(f"MAREY_{name.upper()}", value)
    assert settings().port == 8400


def test_a_secrets_file_that_is_not_there_or_holds_nonsense_is_told_by_the_variable_that_names_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    away = tmp_path / "away"
    missing = refusal(monkeypatch, database_url_file=str(away))
    assert missing.where == "MAREY_DATABASE_URL_FILE"
    assert str(away) in missing.message
    away.write_text("a secret that is no address")
    wrong = refusal(monkeypatch)
    assert wrong.where == "MAREY_DATABASE_URL_FILE"
    assert "secret" not in wrong.message
    away.write_text("postgresql://marey@here/marey\n")
    url = settings().database_url
    assert url is not None
    assert url.get_secret_value() == "postgresql://marey@here/marey"


def test_settings_that_need_each_other_are_looked_at_together(monkeypatch: pytest.MonkeyPatch) -> None:
    refused = refusal(monkeypatch, lease_seconds="2")
    assert refused.where == "MAREY_HEARTBEAT_SECONDS"
    assert "MAREY_LEASE_SECONDS" in (refused.hint or "")
    unnamed = refusal(monkeypatch, lease_seconds="10", rewriter="openai")
    assert unnamed.where == "MAREY_REWRITER_MODEL"


def test_every_number_has_bounds() -> None:
    bare = [
        name
        for name, field in Settings.model_fields.items()
        if field.annotation in (int, float, int | None, float | None) and len(field.metadata) < 2
    ]
    assert bare == []
