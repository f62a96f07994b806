"""The address of the server: `MAREY_SERVER` and `MAREY_KEY`, else `server.json` of a `marey serve` on this machine."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import urlsplit

from marey.core.documents import read_json
from marey.core.errors import InvalidFile, InvalidInput, NotFound, Unauthenticated, Unreachable
from marey.core.whole_files import whole_file

MAX_BYTES = 2**16
MAX_KEY = 2**12
"""Bytes of a file with a key."""
HINT = "Delete it and start `marey serve` again."


@dataclass(frozen=True)
class Server:
    """A server; `pid` is known only for one that runs on this machine."""

    url: str
    key: str
    pid: int | None = None

    @property
    def is_here(self) -> bool:
        """Return True if its host is a loopback address: proxies of the environment cannot reach it."""
        host = urlsplit(self.url).hostname or ""
        try:
            return host == "localhost" or ip_address(host).is_loopback
        except ValueError:
            return False


def home() -> Path:
    """`MAREY_HOME`, by default the user's data folder: database, assets, logs, lock and `server.json`."""
    given = os.environ.get("MAREY_HOME")
    if given:
        return Path(given).expanduser().absolute()
    from platformdirs import user_data_path

    return user_data_path("marey", appauthor=False)


def ca_file() -> Path | None:
    """Return the file of `MAREY_CA_FILE`: certificate authorities that are trusted beside the machine's own."""
    given = os.environ.get("MAREY_CA_FILE")
    return Path(given).expanduser() if given else None


def find_server() -> Server:
    """Return the server that the environment names, or that runs on this machine.

    Raises:
        Unreachable: no server is named, and none runs here.
        Unauthenticated: a server is named, but no key.
    """
    url = os.environ.get("MAREY_SERVER")
    return server_at(url) if url else _local_server()


def server_at(url: str, key: str | None = None) -> Server:
    """Return the server at a URL.

    Args:
        key: None = that of `MAREY_KEY` or `MAREY_KEY_FILE`.

    Raises:
        InvalidInput: it is not a URL.
        Unauthenticated: there is no key, or one with characters that no key has.
    """
    _check_address(url)
    key = _key() if key is None else key
    if not key.isascii() or not key.isprintable() or " " in key:  # no header could hold it
        raise Unauthenticated("this is not an API key", hint="Keys look like marey_<8>_<43>; MAREY_KEY holds yours.")
    return Server(url.rstrip("/"), key)


def _check_address(url: str) -> None:
    """Check that it is an http or https URL with a host, without a user: keys are sent in their own header.

    Raises:
        InvalidInput: it is not.
    """
    try:
        parts = urlsplit(url)
        known = parts.scheme in ("http", "https") and parts.hostname and parts.port != 0
    except ValueError:  # a port that is none, or an open bracket
        known = False
    if not known or not url.isprintable() or " " in url or "\\" in url:
        raise InvalidInput(f"MAREY_SERVER is {url!r}, not a URL", hint="Write it as https://marey.example.com")
    if "@" in urlsplit(url).netloc:
        raise InvalidInput("MAREY_SERVER holds a user or a password", hint="Leave them out: MAREY_KEY is the key.")


def write_server(server: Server, folder: Path) -> None:
    """Write `server.json`, readable by its owner alone, in one step."""
    path = folder / "server.json"
    with whole_file(path, private=True) as part:
        part.write_text(json.dumps(asdict(server)), encoding="utf-8")


def read_server(folder: Path) -> Server | None:
    """Return the server that `folder/server.json` names; None = no such file."""
    path = folder / "server.json"
    try:
        fields = read_json(path, limit=MAX_BYTES, hint=HINT)
        return Server(str(fields["url"]), str(fields["key"]), int(fields["pid"]))
    except NotFound:
        return None
    except (ValueError, KeyError, TypeError) as error:
        raise InvalidFile(f"cannot be read: {error!r}", where=str(path), hint=HINT) from error


def _local_server() -> Server:
    server = read_server(home())
    if server is None and _is_starting(home()):
        raise Unreachable(
            "the server here is starting, or stopping",
            where=str(home()),
            hint="Try again once `marey serve` says `Marey answers at`.",
        )
    if server is None:
        raise Unreachable(
            "no server is running here",
            where=str(home()),
            hint="Start one with `marey serve`, or name one with MAREY_SERVER and MAREY_KEY.",
        )
    return server


def _is_starting(folder: Path) -> bool:
    """Return True if a process is alive that `marey serve` of this home wrote into its lock."""
    try:
        pid = int(read_json(folder / "lock", limit=MAX_BYTES, hint=HINT)["pid"])
        os.kill(pid, 0)
    except (NotFound, InvalidFile, KeyError, TypeError, ValueError, ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True  # it is another user's
    return True


def _key() -> str:
    path = os.environ.get("MAREY_KEY_FILE")
    key = _key_of(Path(path).expanduser()) if path else os.environ.get("MAREY_KEY", "").strip()
    if not key:
        empty = "the file of MAREY_KEY_FILE" if path else "MAREY_KEY"
        raise Unauthenticated(f"MAREY_SERVER names a server, but {empty} is empty", hint="Set MAREY_KEY to your key.")
    return key


def _key_of(path: Path) -> str:
    try:
        with path.open("rb") as file:  # perhaps a pipe, or a device
            return file.read(MAX_KEY).decode("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise InvalidFile(
            f"cannot be read: {reason}", where=str(path), hint="MAREY_KEY_FILE names the file that holds your key."
        ) from error
