"""The API's OpenAPI document, as it is checked in: reading it is a tenth of the work of making it.

`tests/integration/test_api.py` holds that it is the one that the API makes.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

CHECKED_IN = Path(__file__).resolve().parents[2] / "docs" / "openapi.json"


def openapi() -> dict[str, Any]:
    """Return the document."""
    return json.loads(CHECKED_IN.read_text(encoding="utf-8"))
