"""Every setting of the product, read once from the environment (prefix `MAREY_`) and checked there.

Secrets may come from a file: `MAREY_DATABASE_URL_FILE=/run/secrets/db` is read if `MAREY_DATABASE_URL` is unset.
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

from marey.core import defaults
from marey.core.addresses import Allowed
from marey.core.errors import InvalidInput
from marey.core.origins import check_origins
from marey.core.rates import check_rates

PREFIX = "MAREY_"
BY_FILE = (
    *("database_url", "listen_url", "queue_url", "streams_url", "s3_access_key", "s3_secret_key", "rewriter_key"),
    *("webhook_key", "text_key"),
)
"""Settings that may come from a file."""
LONGEST = 366 * 86_400
"""Maximum of durations, in seconds; some clocks cannot count further."""
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
    host = re.split("[/?]", rest.rpartition("@")[2], maxsplit=1)[0]  # a password may hold any character
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
    """Folder of model bundles; unset = `models` of the checkout, when running from one."""

    database_url: Database | None = None
    """`postgresql+psycopg://…`; unset = the embedded Postgres of `home`."""

    listen_url: Database | None = None
    """URL of the same database without a transaction pooler, for LISTEN; unset = `database_url`."""

    queue_url: Queue | None = None
    """`redis://…` or `redis+socket://…`; unset = the embedded Valkey of `home`."""

    streams_url: Queue | None = None
    """Redis of the frame streams; unset = `queue_url`."""

    store: str | None = None
    """`s3://bucket` or a folder; unset = `home/assets`."""

    s3_endpoint: Endpoint = "objectstore:9000"
    """Address of the object store: a URL, or host and port with the scheme from `s3_secure`."""
    s3_public_endpoint: Endpoint | None = None
    """The address in presigned URLs, where clients reach the store under another name or scheme."""
    s3_access_key: SecretStr | None = None
    s3_secret_key: SecretStr | None = None
    s3_region: str = "us-east-1"  # if unset, the client requests it from the network before every presigned URL
    s3_secure: bool = False
    """Use https for an endpoint without a scheme."""

    ca_file: Path | None = None
    """PEM file of certificate authorities that are trusted in addition to the machine's own, for every https
    connection: the API, the object store, webhooks, the language model of a rewriter."""

    host: str = "127.0.0.1"
    port: Port = 8400
    allowed_hosts: Names = ["127.0.0.1", "localhost", "[::1]"]
    cors_origins: Names = []
    """Origins of web pages that may use the API from a browser, as `["https://app.example.com"]`, exactly; also for
    WebSockets. None by default."""
    idle_seconds: Seconds = 20.0
    """Seconds until a connection to the API without a request, or with an incomplete request head, is closed."""
    body_seconds: Seconds = 600.0
    """Seconds until the body of a request must be complete: 64 MiB at 110 KiB a second."""
    body_pause_seconds: Seconds = 20.0
    """Total seconds that a body may arrive slower than 4 KiB a second."""
    rates: Annotated[dict[str, str], NoDecode, BeforeValidator(_of_json)] = {}
    """Rate limits of a key, by class of request (`marey.core.rates`): `{"read": "6000/minute", "submit":
    "600/minute"}`. Omitted classes are unlimited, as all are by default; `docker-compose.yml` sets all."""

    sockets_per_tenant: int = Field(default=100, ge=1, le=100_000)
    """Sockets of live streams that one tenant may open at one API process, of 200."""
    sockets_per_key: int = Field(default=50, ge=1, le=100_000)
    """The same of one key."""
    event_streams: int = Field(default=4000, ge=1, le=100_000)
    """Streams of server-sent events that may be open at one API process."""
    event_streams_per_tenant: int = Field(default=2000, ge=1, le=100_000)
    event_streams_per_key: int = Field(default=1000, ge=1, le=100_000)
    made_files_bytes: int = Field(default=2**30, ge=0, le=2**50)
    """Bytes of the files of one tenant that the API made on request and keeps; the oldest are removed first."""
    rig_bytes: int = Field(default=64 * 2**20, ge=1, le=64 * 2**20)
    """Bytes of the file of one rig that a tenant adds."""
    rigs_per_tenant: int = Field(default=100, ge=0, le=100_000)
    """Rigs that one tenant may have."""
    text_url: TextService | None = None
    """URL of the text service (`marey text serve`) for the API; `marey serve` starts its own."""
    text_key: SecretStr | None = None
    """Secret that the API sends to the text service."""
    text_seconds: Seconds = 10.0
    """Seconds until a request to parse prompts is answered with 503."""

    require_licence: Literal["any", "commercial"] = "any"
    """`commercial` refuses bundles whose weights have non-commercial terms."""

    device: Annotated[str, AfterValidator(_device)] = "auto"
    """`auto`, `cpu`, `cuda`, `cuda:1`, …"""
    threads: int = Field(default=0, ge=0, le=1024)
    """Torch threads of one worker; 0 = cores divided by the torch children of this machine."""

    lease_seconds: Seconds = 10.0
    """Seconds until an unrenewed claim of a worker is given to others."""
    heartbeat_seconds: Seconds = Field(default=2.5, validate_default=True)
    """Seconds between renewals of a worker's leases."""
    stall_seconds: Seconds = 120.0
    """A decode loop without progress for this long loses its lease (first load and compile excepted)."""
    sweep_seconds: Seconds = 2.0
    relay_seconds: Seconds = 0.5
    evaluation_seconds: Seconds = 2.0
    """Seconds between the scheduler's checks for due schedules and open evaluations."""
    retention_seconds: Seconds = 60.0
    """Seconds between the scheduler's checks for expired jobs, and for files with erased prompts."""
    max_attempts: int = Field(default=3, ge=1, le=1000)
    """Attempts of an item that fails, or whose worker dies."""
    drain_seconds: Seconds = 300.0
    """Seconds after which a drain task claims no more and returns."""

    rewriter: Literal["none", "rules", "openai", "tca"] | None = None
    """Rewriter that adapts prompts to the words of captions; unset = the bundle's own, usually `none`. The API and
    all workers need the same value."""
    rewriter_url: Web = "https://api.openai.com/v1"
    """Of `openai` and `tca`: any endpoint that speaks `POST /chat/completions`."""
    rewriter_model: str | None = Field(default=None, validate_default=True)
    rewriter_key: SecretStr | None = None
    rewriter_seconds: float = Field(default=10.0, gt=0, le=60)
    """Seconds for one prompt, with all attempts; after that the original prompt is used."""

    public_url: Web | None = None
    """URL of the API for clients, such as `https://marey.example.com`; used in webhooks. Unset = `host` and `port`."""
    webhook_allow: Names = ["public"]
    """Networks that webhooks may reach, such as `["public", "10.1.0.0/16"]`; `public` = the internet, over https."""
    webhook_key: SecretStr | None = None
    """Fernet keys of webhooks' signing secrets: the first encrypts, all decrypt. `marey serve` creates its own."""
    webhook_seconds: Seconds = 1.0
    """Seconds between the scheduler's checks for due webhook deliveries."""

    role: str | None = None
    """Queues that `marey worker` serves where its command line names none, as hgm3+text; models = every model that
    has a bundle here."""
    default_model: str = defaults.MODEL
    """Model of items that name none."""
    live_model: str | None = None
    """Model or bundle of live streams that name none; live workers of its model load that bundle. Unset = the only
    installed model that streams, or the only one of these that has a bundle."""
    live_slots: int = Field(default=4, ge=0, le=1000)
    """Live streams of one worker at once."""
    streams_per_key: int = Field(default=4, ge=0, le=1000)
    """Open live streams of one API key."""
    stream_idle_seconds: Seconds = 60.0
    """Seconds without a viewer until a live stream ends."""
    stream_paused_seconds: Seconds = 600.0
    """Seconds of pause until a live stream ends, with or without viewers: it occupies a slot."""

    audit_days: float = Field(default=400.0, gt=0, le=36_525)
    """Retention of the audit log."""

    metrics_host: str = "127.0.0.1"
    metrics_port: int | None = Field(default=None, ge=1, le=65535)
    """Port of the Prometheus endpoint of workers and the scheduler, without a key; unset = disabled. Each process
    needs a port of its own: `marey serve` counts up from this one. The API has `/metrics`."""

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
        rewriter = info.data.get("rewriter")
        if value is None and rewriter in ("openai", "tca"):
            raise ValueError(f"MAREY_REWRITER={rewriter} needs the name of your language model.")
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
        InvalidInput: a variable has an invalid value.
    """
    try:
        return Settings()
    except ValidationError as error:
        raise _describe(error) from None  # pydantic's messages quote secrets


def _secret_of(path: Path, variable: str) -> str:
    try:
        return path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        hint = "It names the file that holds the secret."
        raise InvalidInput(f"{str(path)!r} cannot be read: {reason}", where=variable, hint=hint) from error


def _describe(error: ValidationError) -> InvalidInput:
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
"""Descriptions by type, for types that need no bounds."""
