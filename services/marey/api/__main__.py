"""`python -m marey.api docs/openapi.json` writes the checked-in OpenAPI document."""

import sys
from pathlib import Path

from marey.api.app import write_openapi

write_openapi(Path(sys.argv[1]))
