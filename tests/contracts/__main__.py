"""Record every surface as it is now: `python -m tests.contracts`."""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

from marey.db import create_engine, upgrade
from marey.embedded import start_postgres
from marey.embedded.postgres import _postgres
from marey.registry import model_names
from tests.contracts.figures import figures
from tests.contracts.motions import motion, processor
from tests.contracts.story import events
from tests.contracts.surfaces import SURFACES, database, of_model

RECORDED = Path(__file__).parent / "recorded"
MODELS = Path(__file__).parents[1] / "models"


def file_of(model: str) -> Path:
    """The file of a model's own surfaces: beside its tests, with which it goes."""
    return MODELS / model / "recorded.json"


def pg_dump_program() -> Path:
    """`pg_dump` of the embedded Postgres."""
    return _postgres("pg_dump")


def main() -> None:
    """Write the files of `recorded/`, and of each model."""
    argparse.ArgumentParser(prog="python -m tests.contracts", description=__doc__).parse_args()
    found: dict[str, Any] = {name: read() for name, read in SURFACES.items()}
    with tempfile.TemporaryDirectory(prefix="marey-") as home, start_postgres(Path(home), durable=False) as server:
        engine = create_engine(server.url)
        upgrade(engine)
        found["database"] = database(pg_dump_program(), server.url)
        found["events"] = events(engine)
        engine.dispose()
    for name, value in found.items():
        _write(RECORDED / f"{name}.json", value)
    write_figures()
    for model in model_names():
        surfaces = of_model(model)
        made = {name: motion(name) for name in surfaces["bundle_tensors"]}
        _write(file_of(model), surfaces | {"motions": made, "processor": processor()})


def write_figures() -> None:
    """Write those of motions, one a line."""
    lines = [
        f" {json.dumps(part)}: {{\n"
        + ",\n".join(f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in sorted(of.items()))
        + "\n }"
        for part, of in sorted(figures().items())
    ]
    (RECORDED / "motion.json").write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def _write(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
