"""docs/reference/settings.md: a line for every variable that is read, none for another, the defaults as they are."""

from __future__ import annotations

import json
import re
from pathlib import Path

from pydantic import SecretStr

from marey.core.settings import BY_FILE, Settings
from marey.runtime.child import NAME_VARIABLE, ROLE_VARIABLE

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / "docs" / "reference" / "settings.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| `(MAREY_[A-Z0-9_]+)`( ¹)? \| (.*?) \| .* \|$", re.MULTILINE)
ROWS = {name: (bool(by_file), default) for name, by_file, default in ROW.findall(PAGE)}
READ = re.compile(r"environ(?:\.get\(|\[)\s*\"(MAREY_[A-Z0-9_]+)\"")
OURS = {ROLE_VARIABLE, NAME_VARIABLE}
"""Variables that a worker sets for its own child."""


def read_by_hand() -> set[str]:
    """Variables that the code reads past `Settings`."""
    sources = [path for room in ("shared", "services", "workers") for path in (REPOSITORY / room).rglob("*.py")]
    return {name for path in sources for name in READ.findall(path.read_text(encoding="utf-8"))}


def written(value: object) -> str:
    """A default as the page writes it."""
    return value if isinstance(value, str) else json.dumps(value)


def test_every_variable_has_a_line_and_no_line_is_of_another() -> None:
    of_settings = {f"MAREY_{name.upper()}" for name in Settings.model_fields}
    assert "MAREY_SERVER" in read_by_hand()
    assert set(ROWS) == of_settings | (read_by_hand() - OURS)


def test_no_variable_has_two_lines() -> None:
    assert len(ROW.findall(PAGE)) == len(ROWS)


def test_the_defaults_are_those_of_the_code() -> None:
    for name, field in Settings.model_fields.items():
        default = field.default
        if default is None or name in ("home", "models"):
            continue
        shown = f"{default:g}" if isinstance(default, float) else written(default)
        assert ROWS[f"MAREY_{name.upper()}"][1].startswith(f"`{shown}`"), name


def test_what_may_come_by_file_is_marked() -> None:
    marked = {name for name, (by_file, _) in ROWS.items() if by_file}
    assert marked == {f"MAREY_{name.upper()}" for name in BY_FILE}
    secrets = {name for name, field in Settings.model_fields.items() if SecretStr.__name__ in str(field.annotation)}
    assert secrets == set(BY_FILE)


def test_the_readme_leads_there() -> None:
    assert "(docs/reference/settings.md)" in (REPOSITORY / "README.md").read_text(encoding="utf-8")
