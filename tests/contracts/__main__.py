"""Record every surface as it is now: `python -m tests.contracts`."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from marey.db import create_engine, upgrade
from marey.embedded import start_postgres
from marey.embedded.postgres import _postgres
from tests.contracts.motions import BUNDLES, motion, processor
from tests.contracts.story import events
from tests.contracts.surfaces import SURFACES, database

RECORDED = Path(__file__).parent / "recorded"


def pg_dump_program() -> Path:
    """`pg_dump` of the embedded Postgres."""
    return _postgres("pg_dump")


def main() -> None:
    """Write the files of `recorded/`."""
    found: dict[str, Any] = {name: read() for name, read in SURFACES.items()}
    with tempfile.TemporaryDirectory(prefix="marey-") as home, start_postgres(Path(home), durable=False) as server:
        engine = create_engine(server.url)
        upgrade(engine)
        found["database"] = database(pg_dump_program(), server.url)
        found["events"] = events(engine)
        engine.dispose()
    found["motions"] = {"processor": processor()} | {name: motion(name) for name in BUNDLES}
    for name, value in found.items():
        text = json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
        (RECORDED / f"{name}.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
