"""Every setting of the product, read once from the environment (prefix `MAREY_`).

Secrets may come by file: `MAREY_DATABASE_URL_FILE=/run/secrets/db` is read where `MAREY_DATABASE_URL` is unset.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import Literal

from platformdirs import user_data_path
from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from shared.errors import InvalidInput
from shared.rates import check_rates

REPOSITORY = Path(__file__).resolve().parents[1]


class Settings(BaseSettings):
    """Settings of every process; the defaults are those of the embedded profile."""

    model_config = SettingsConfigDict(env_prefix="MAREY_", extra="ignore")

    home: Path = Field(default_factory=lambda: user_data_path("marey", appauthor=False))
    """Database, assets, logs, lock and `server.json` of the embedded server."""

    models: Path = REPOSITORY / "models"
    """Folder of the model bundles."""

    database_url: SecretStr | None = None
    """`postgresql+psycopg://…`; unset = the embedded Postgres of `home`."""

    queue_url: SecretStr | None = None
    """`redis://…` or `redis+socket://…`; unset = the embedded Valkey of `home`."""

    streams_url: SecretStr | None = None
    """Redis of the frame streams; unset = `queue_url`."""

    store: str | None = None
    """`s3://bucket` or a folder; unset = `home/assets`."""

    s3_endpoint: str = "objectstore:9000"
    s3_public_endpoint: str | None = None
    """Endpoint that stands in presigned URLs, where clients reach the store under another name."""
    s3_access_key: SecretStr | None = None
    s3_secret_key: SecretStr | None = None
    s3_region: str = "us-east-1"  # set, else the client asks the network for it before every presigned URL
    s3_secure: bool = False

    host: str = "127.0.0.1"
    port: int = 8400
    allowed_hosts: list[str] = ["127.0.0.1", "localhost", "[::1]"]
    idle_seconds: float = Field(default=20.0, gt=0)
    """A connection to the API that asks for nothing for so long is closed, and so is one whose request has no whole
    head by then."""
    body_seconds: float = Field(default=600.0, gt=0)
    """The body of a request must be here after this long: 64 MiB at 110 KiB a second."""
    body_pause_seconds: float = Field(default=20.0, gt=0)
    """It may be slower than 4 KiB a second for this long in all."""
    rates: dict[str, str] = {}
    """Requests that a key may make, by class (`shared.rates`): `{"read": "6000/minute", "submit": "600/minute"}`. What
    is not named has no limit, as nothing has on a machine of one's own; `docker-compose.yml` sets all."""

    require_licence: Literal["any", "commercial"] = "any"
    """`commercial` refuses bundles whose weights carry non-commercial terms."""

    device: str = "auto"
    """`auto`, `cpu`, `cuda`, `cuda:1`, …"""
    threads: int = 0
    """Torch threads of one worker; 0 = cores divided by the torch children of this machine."""

    lease_seconds: float = 10.0
    heartbeat_seconds: float = 2.5
    stall_seconds: float = 120.0
    """A decode loop without progress for this long loses its lease (first load and compile excepted)."""
    sweep_seconds: float = 2.0
    relay_seconds: float = 0.5
    evaluation_seconds: float = 2.0
    """The scheduler looks this often whether a schedule is due or an evaluation can go on."""
    retention_seconds: float = 60.0
    """The scheduler looks this often for jobs whose days are over, and for files with erased prompts."""
    max_attempts: int = 3
    drain_seconds: float = 300.0
    """A drain task claims nothing after this long and returns."""

    rewriter: Literal["none", "rules", "openai"] | None = None
    """Brings prompts into the words of captions before they are read; unset = what the bundle says, usually `none`.
    The API and all workers need the same."""
    rewriter_url: str = "https://api.openai.com/v1"
    """Of `openai`: any endpoint that speaks `POST /chat/completions`."""
    rewriter_model: str | None = None
    rewriter_key: SecretStr | None = None
    rewriter_seconds: float = Field(default=10.0, gt=0, le=60)
    """For one prompt, with all tries; then it is read as it was written."""

    public_url: str | None = None
    """Where clients reach the API, as `https://marey.example.com`; stands in webhooks. Unset = `host` and `port`."""
    webhook_allow: list[str] = ["public"]
    """Networks that webhooks may tell, as `["public", "10.1.0.0/16"]`; `public` = the internet, by https."""
    webhook_key: SecretStr | None = None
    """Fernet keys of webhooks' signing secrets: the first encrypts, all decrypt. `marey serve` brings its own."""
    webhook_seconds: float = 1.0
    """The scheduler looks this often whether there is something to tell."""

    live_slots: int = 4
    """Live streams of one worker at once."""
    streams_per_key: int = 4
    """Open live streams of one API key."""
    stream_idle_seconds: float = 60.0
    """A live stream that nobody watches ends after this long."""

    audit_days: float = Field(default=400.0, gt=0)
    """The audit log is kept this long."""

    metrics_host: str = "127.0.0.1"
    metrics_port: int | None = Field(default=None, ge=1, le=65535)
    """Where workers and the scheduler tell Prometheus their numbers, without a key; unset = nowhere. Each process needs
    a port of its own: `marey serve` counts up from this one. The API has `/metrics`."""

    log_level: str = "INFO"
    log_json: bool = False

    @property
    def api_url(self) -> str:
        """Where clients reach the API, without a slash at the end."""
        return self.local_url if self.public_url is None else self.public_url.rstrip("/")

    @property
    def local_url(self) -> str:
        """Where clients on this machine reach the API."""
        name = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)  # noqa: S104
        return f"http://[{name}]:{self.port}" if ":" in name else f"http://{name}:{self.port}"

    @field_validator("rates")
    @classmethod
    def _known_rates(cls, values: dict[str, str]) -> dict[str, str]:
        try:
            return check_rates(values, where="MAREY_RATES")
        except InvalidInput as error:
            raise ValueError(str(error)) from error

    @model_validator(mode="before")
    @classmethod
    def _secrets_by_file(cls, values: dict[str, object]) -> dict[str, object]:
        for name in (
            *("database_url", "queue_url", "streams_url", "s3_access_key", "s3_secret_key", "rewriter_key"),
            "webhook_key",
        ):
            path = os.environ.get(f"MAREY_{name.upper()}_FILE")
            if path and name not in values:
                values[name] = Path(path).read_text(encoding="utf-8").strip()
        return values


@lru_cache(maxsize=1)
def settings() -> Settings:
    """The settings of this process."""
    return Settings()
