"""Content security policies of pages."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable


def policy_hashes(texts: Iterable[str]) -> list[str]:
    """Return the sources of a policy that allow inline scripts or styles with these texts."""
    return [f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" for text in texts]
