"""Signing secrets at rest, encrypted under a key that is not in the database: a copy of the database alone signs
nothing.

`MAREY_WEBHOOK_KEY` may hold several keys: the first encrypts, all decrypt, so that keys can be rotated. `marey
    serve` creates one in a file of its home.
"""

from __future__ import annotations

import base64
import secrets
from pathlib import Path

from cryptography.fernet import Fernet, InvalidToken, MultiFernet

from marey.core.errors import InvalidInput, Refused
from marey.core.settings import Settings
from marey.core.whole_files import whole_file

KEY_FILE = "webhook.key"
WHERE = "MAREY_WEBHOOK_KEY"
SECRET_BYTES = 32
PREFIX = "whsec_"


class Vault:
    """Encrypts and decrypts signing secrets."""

    def __init__(self, keys: str) -> None:
        """
        Args:
            keys: Fernet keys, separated by white space or commas.

        Raises:
            InvalidInput: no keys, or invalid ones.
        """
        try:
            self._fernet = MultiFernet([Fernet(key) for key in keys.replace(",", " ").split()])
        except ValueError as error:
            hint = "A key is 32 random bytes in URL-safe base64: `openssl rand -base64 32 | tr +/ -_`."
            raise InvalidInput("is not a list of keys", where=WHERE, hint=hint) from error

    @classmethod
    def of(cls, config: Settings) -> Vault:
        """Return the vault of this installation.

        Raises:
            Refused: no key is configured.
            InvalidInput: the key is invalid.
        """
        if config.webhook_key is None:
            raise Refused(
                "this server has no key for the secrets of webhooks", where=WHERE, hint="Its operator sets one."
            )
        return cls(config.webhook_key.get_secret_value())

    def encrypt(self, secret: str) -> bytes:
        """Encrypt a secret for the database."""
        return self._fernet.encrypt(secret.encode())

    def decrypt(self, stored: bytes) -> str:
        """Decrypt a stored secret.

        Raises:
            InvalidInput: it was encrypted under another key.
        """
        try:
            return self._fernet.decrypt(stored).decode()
        except InvalidToken as error:
            hint = "Give the key that was in force then as well, behind the new one."
            raise InvalidInput("does not open this webhook's secret", where=WHERE, hint=hint) from error


def new_signing_secret() -> str:
    """Return a new secret in the form of Standard Webhooks: `whsec_` and base64."""
    return PREFIX + base64.b64encode(secrets.token_bytes(SECRET_BYTES)).decode()


def key_file(folder: Path) -> Path:
    """Return the file with this folder's key, readable by its owner alone; create it if missing."""
    path = folder / KEY_FILE
    if not path.exists():
        with whole_file(path, private=True, durable=True) as part:
            part.write_bytes(Fernet.generate_key() + b"\n")
    return path
