"""Build the documentation site: `python docs/build_site.py [OUT]` (default: out). The pages are in OUT/site.

The pages of docs/, the model cards and the project files are copied to OUT/pages, the reference of commands, of
configurations and of HTTP routes is generated there, and Zensical builds the site strictly, without a network
(docs/decisions/0016).
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PROJECT = ("ROADMAP.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md")
COPIED = {".md", ".png", ".svg", ".json", ".css"}
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!https?:|mailto:|#)([^)#\s]+)(#[^)\s]*)?\)")
FENCE = re.compile(r"^\s*```")
UNSAFE = re.compile(r"(`[^`]*`)|([<*_|])")
"""Code, which stays as it is, or a character that Markdown would take for its own."""


def main(arguments: list[str]) -> int:
    """Build the site and return the exit code of Zensical."""
    out = Path(arguments[0] if arguments else "out").resolve()
    pages = out / "pages"
    shutil.rmtree(pages, ignore_errors=True)
    places = collect()
    for source, place in places.items():
        target = pages / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.suffix == ".md":
            target.write_text(relink(source, place, places), encoding="utf-8")
        else:
            shutil.copyfile(source, target)
    reference = json.loads((DOCS / "openapi.json").read_text(encoding="utf-8"))
    (pages / "reference" / "cli.md").write_text(command_page(), encoding="utf-8")
    (pages / "reference" / "configurations.md").write_text(configuration_page(), encoding="utf-8")
    (pages / "reference" / "http-api.md").write_text(route_page(reference), encoding="utf-8")
    return zensical(out)


def collect() -> dict[Path, str]:
    """Return every file of the site with its place among the pages."""
    own = {path: path.relative_to(DOCS).as_posix() for path in sorted(DOCS.rglob("*")) if path.suffix in COPIED}
    cards = {path: f"models/{path.parent.name}.md" for path in sorted(ROOT.glob("models/*/README.md"))}
    return own | cards | {ROOT / name: name for name in PROJECT}


def relink(source: Path, place: str, places: Mapping[Path, str]) -> str:
    """Return the text of a page with its links between pages; a link to a file outside the site becomes its text."""

    def link(found: re.Match[str]) -> str:
        image, text, name, anchor = found[1], found[2], found[3], found[4] or ""
        target = (source.parent / name).resolve()
        if target.is_dir() and target / "README.md" in places:
            target = target / "README.md"
        if target not in places:
            if not target.exists() or image:
                raise SystemExit(f"{source}: the link to {name} leads nowhere")
            return text
        path = os.path.relpath(places[target], Path(place).parent)
        return f"{image}[{text}]({path}{anchor})"

    lines, fenced = [], False
    for line in source.read_text(encoding="utf-8").splitlines():
        fenced ^= bool(FENCE.match(line))
        lines.append(line if fenced else LINK.sub(link, line))
    return "\n".join(lines) + "\n"


def zensical(out: Path) -> int:
    """Run Zensical on OUT/pages with the settings of mkdocs.yml."""
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    (out / "mkdocs.yml").write_text(settings.replace("docs_dir: docs", "docs_dir: pages"), encoding="utf-8")
    shutil.rmtree(out / "site", ignore_errors=True)
    program = Path(sys.executable).parent / "zensical"
    done = subprocess.run([program, "build", "--strict", "--clean", "-f", out / "mkdocs.yml"], check=False, cwd=out)
    return done.returncode


# --- commands ---


def command_page() -> str:
    """Return the reference of every command, from the command tree."""
    import typer

    from marey.cli.main import app

    return "# Commands\n\n" + "\n".join(_command(typer.main.get_command(app), "marey", None))


def _command(command: Any, name: str, parent: Any) -> Iterator[str]:
    context = command.make_context(name.split()[-1], [], parent=parent, resilient_parsing=True)
    if parent is not None:
        yield f"{'#' * len(name.split())} {name}\n"
    yield f"```text\n{command.get_usage(context).removeprefix('Usage: ')}\n```\n"
    yield _prose(command.help or "")
    rows = [_parameter(each, context) for each in command.get_params(context) if not getattr(each, "hidden", False)]
    if rows:
        yield "| argument or option | meaning |\n|---|---|\n" + "\n".join(rows) + "\n"
    children: Mapping[str, Any] = getattr(command, "commands", {})
    for child in command.list_commands(context) if children else ():
        if not children[child].hidden:
            yield from _command(children[child], f"{name} {child}", context)


def _parameter(parameter: Any, context: Any) -> str:
    name, text = parameter.get_help_record(context) or (parameter.make_metavar(context), "")
    return f"| {_code(name)} | {_cell(text)} |"


# --- configurations ---


def configuration_page() -> str:
    """Return the reference of every field that a configuration file of a training may set."""
    from marey.registry import trainings
    from marey.training.config_file import PRESET

    about = (
        "Fields of the files that `marey train … --config FILE.toml` reads. A file begins with a line such as "
        f'`{PRESET} = "starter"`, and sets what differs, by table: `train_masked.batch` is `batch` under '
        "`[train_masked]`. `marey train MODEL config` prints a whole file."
    )
    return "\n".join(["# Configurations", "", about, *(_configuration(*each) for each in trainings().items())])


def _configuration(name: str, training: Any) -> str:
    from marey.registry import resolve
    from marey.training.config_file import list_fields

    named = resolve(training.config)
    published = {field.path: field.value for field in list_fields(named("paper"))}
    rows = [
        f"| `{field.path}` | {_value(field.value)} | {_value(published[field.path])} | {_cell(field.takes)} "
        f"| {_cell(field.about)} |"
        for field in list_fields(named("starter"))
    ]
    head = "| field | `starter` | `paper` | takes | meaning |\n|---|---|---|---|---|"
    return "\n".join([f"\n## {name}\n", head, *rows, ""])


def _value(value: Any) -> str:
    return _code(json.dumps(value))  # nearly as in the file: a tuple is a list


# --- routes ---


def route_page(document: Mapping[str, Any]) -> str:
    """Return the reference of every HTTP route and schema, from the OpenAPI document."""
    routes = [
        (operation["tags"][0], path, method.upper(), operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    parts = [f"# HTTP API\n\n{document['info']['description']}\n\nA running server shows this at `/docs`, to try too."]
    for tag in dict.fromkeys(route[0] for route in routes):
        parts.append(f"## {tag.capitalize()}")
        parts += [_route(path, method, operation) for of, path, method, operation in routes if of == tag]
    parts.append("## Schemas")
    parts += [_schema(name, schema) for name, schema in sorted(document["components"]["schemas"].items())]
    return "\n\n".join(parts) + "\n"


def _route(path: str, method: str, operation: Mapping[str, Any]) -> str:
    parts = [f"### {method} {path}", _prose(operation.get("description") or operation["summary"])]
    scopes = [scope for entry in operation.get("security", []) for needed in entry.values() for scope in needed]
    parts += [f"Scope: {', '.join(f'`{scope}`' for scope in scopes)}."] if scopes else []
    rows = [_argument(each) for each in operation.get("parameters", [])]
    parts += ["| parameter | in | type | meaning |\n|---|---|---|---|\n" + "\n".join(rows)] if rows else []
    body = operation.get("requestBody", {}).get("content", {})
    kinds = [f"`{kind}` {_type(each.get('schema', {}))}" for kind, each in body.items()]
    parts += [f"Body: {', '.join(kinds)}."] if kinds else []
    answers = [_answer(status, each) for status, each in operation["responses"].items()]
    parts.append("| answer | meaning | content |\n|---|---|---|\n" + "\n".join(answers))
    return "\n\n".join(part for part in parts if part)


def _argument(parameter: Mapping[str, Any]) -> str:
    mark = " (required)" if parameter.get("required") else ""
    text = _cell(parameter.get("description", ""))
    return f"| `{parameter['name']}`{mark} | {parameter['in']} | {_type(parameter['schema'])} | {text} |"


def _answer(status: str, answer: Mapping[str, Any]) -> str:
    kinds = [f"`{kind}` {_type(each.get('schema', {}))}" for kind, each in answer.get("content", {}).items()]
    return f"| {status} | {_cell(answer.get('description', ''))} | {', '.join(kinds)} |"


def _schema(name: str, schema: Mapping[str, Any]) -> str:
    marks = dict.fromkeys(schema.get("required", []), " (required)")
    rows = [
        f"| `{field}`{marks.get(field, '')} | {_type(each)} | {_cell(each.get('description', ''))} |"
        for field, each in schema.get("properties", {}).items()
    ]
    table = "| field | type | meaning |\n|---|---|---|\n" + "\n".join(rows) if rows else _type(schema)
    return "\n\n".join(part for part in (f"### {name}", _prose(schema.get("description", "")), table) if part)


def _type(schema: Mapping[str, Any]) -> str:
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        return f"[{name}](#{name.lower()})"
    for key in ("anyOf", "oneOf", "allOf"):
        if key in schema:
            return " or ".join(dict.fromkeys(_type(each) for each in schema[key]))
    if "enum" in schema or "const" in schema:
        return " or ".join(f"`{value}`" for value in schema.get("enum", [schema.get("const")]))
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items', {}))}"
    name = str(schema.get("format") or schema.get("type", "any"))
    limits = {"minimum": "≥ ", "maximum": "≤ ", "maxLength": "length ≤ ", "default": "default "}
    said = [f"{word}{_code(json.dumps(schema[key]))}" for key, word in limits.items() if schema.get(key) is not None]
    return ", ".join([name, *said])


# --- text ---


def _prose(text: str) -> str:
    escaped = UNSAFE.sub(lambda found: found[1] or f"\\{found[2]}", text.replace("\b\n", ""))
    return escaped.strip() + "\n" if text else ""


def _cell(text: str) -> str:
    return _prose(" ".join(text.split())).strip()


def _code(text: str) -> str:
    return f"`{text}`"  # also with a pipe: in code it does not end a cell


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
