"""`docker-compose.yml`: what it names is there, what it promises holds. `tests/integration/deploy` runs it."""

from __future__ import annotations

import re

import pytest
import typer

from marey.cli import children
from marey.cli.main import app
from marey.cli.roles.serving import EVERY_MODEL, known_queues, parse_roles
from marey.core.settings import Settings
from marey.registry import model_names
from marey.runtime import worker
from marey.runtime.live import main as live
from marey.scheduler import main as scheduler
from tests.support.compose import Service, image_environment, read_compose, services

ALL = services()
OURS = [service for service in ALL.values() if service.ours]
SECRET_VARIABLE = re.compile(r"MAREY_(?P<name>\w+)_FILE")
PINNED = re.compile(r"[\w./-]+:[\w.-]+@sha256:[0-9a-f]{64}")

each = pytest.mark.parametrize("service", ALL.values(), ids=lambda service: service.name)
each_of_ours = pytest.mark.parametrize("service", OURS, ids=lambda service: service.name)


def settings_of(service: Service, monkeypatch: pytest.MonkeyPatch, secrets: str) -> Settings:
    """The settings of its process."""
    for name, value in (image_environment(service.target) | service.environment).items():
        if name.startswith("MAREY_"):
            monkeypatch.setenv(name, value.replace("/run/secrets", secrets))
    return Settings()


def test_every_part_of_the_platform_is_there() -> None:
    ours = {"migrate", "api", "scheduler", "parser", "text", "worker", "editor", "evaluator"}
    assert set(ALL) == ours | {"postgres", "redis", "objectstore"}
    assert {service.name for service in OURS} == ours
    workers = [service for service in OURS if service.command[0] == "worker"]
    roles = [service.command[1] if service.command[1:] else service.environment["MAREY_ROLE"] for service in workers]
    assert sorted(roles) == ["edit", "evaluator", "models", "text"]
    assert {*roles} - {EVERY_MODEL} | {*model_names()} == {*known_queues()}


def test_a_plug_in_is_served_without_an_edit_of_the_file() -> None:
    chosen = services({"MAREY_ROLE": "hgm3+sway", "MAREY_PLUGINS": "marey-sway==1.0.0"})
    assert chosen["worker"].environment["MAREY_ROLE"] == "hgm3+sway"
    built = [service.raw["build"]["args"]["PLUGINS"] for service in chosen.values() if service.ours]
    assert set(built) == {"marey-sway==1.0.0"}


@each
def test_a_service_can_do_nothing_beside_its_work(service: Service) -> None:
    raw = service.raw
    user = raw["user"].split(":")[0]
    assert user.isdigit()
    assert user != "0"
    assert raw["read_only"] is True
    assert raw["cap_drop"] == ["ALL"]
    assert raw["security_opt"] == ["no-new-privileges:true"]
    assert "privileged" not in raw
    assert "cap_add" not in raw
    assert all(raw.get(limit) for limit in ("mem_limit", "cpus", "pids_limit"))
    assert raw["logging"]["options"]["max-size"]


@each
def test_a_service_says_whether_it_is_healthy(service: Service) -> None:
    if service.check is None:
        assert service.name == "migrate", "it ends"
    else:
        assert service.check[0] in {"CMD", "CMD-SHELL"}
        assert service.raw["healthcheck"]["start_period"]


@each
def test_only_the_api_and_the_asset_store_are_published_and_on_loopback_alone(service: Service) -> None:
    published = service.raw.get("ports", [])
    assert bool(published) == (service.name in {"api", "objectstore"})
    assert all(port.startswith("127.0.0.1:") for port in published)


def test_the_network_of_database_and_metrics_leads_nowhere() -> None:
    assert read_compose()["networks"]["back"] == {"internal": True}
    outside = {service.name for service in ALL.values() if service.raw["networks"] != ["back"]}
    assert outside == {"api", "scheduler", "objectstore"}


@pytest.mark.parametrize("service", [s for s in ALL.values() if not s.ours], ids=lambda service: service.name)
def test_an_image_of_others_is_named_by_tag_and_digest(service: Service) -> None:
    assert PINNED.fullmatch(service.raw["image"])


@each_of_ours
def test_a_command_is_one_of_the_command_line_with_arguments_it_takes(service: Service) -> None:
    command, arguments = typer.main.get_command(app), list(service.command)
    while hasattr(command, "commands"):
        command = command.commands[arguments.pop(0)]  # pyright: ignore[reportAttributeAccessIssue]
    command.make_context(service.name, arguments)  # refuses what it does not know
    if service.command[0] == "worker":
        (role,) = service.command[1:] or [service.environment["MAREY_ROLE"]]
        assert role == EVERY_MODEL or parse_roles(role) == [tuple(role.split("+"))]


@each_of_ours
def test_every_variable_is_a_setting(service: Service) -> None:
    names = {name for name in image_environment(service.target) | service.environment if name.startswith("MAREY_")}
    files = {found["name"] for name in names if (found := SECRET_VARIABLE.fullmatch(name))}
    plain = {name.removeprefix("MAREY_") for name in names if not SECRET_VARIABLE.fullmatch(name)}
    assert {name.lower() for name in plain | files} <= set(Settings.model_fields)


@each_of_ours
def test_settings_load_and_every_secret_reaches_one(
    service: Service, monkeypatch: pytest.MonkeyPatch, secrets: dict[str, str], secrets_folder: str
) -> None:
    found = settings_of(service, monkeypatch, secrets_folder)
    for name in service.secrets:
        assert getattr(found, name).get_secret_value() == secrets[name]
    assert found.store == (None if service.name == "parser" else "s3://marey")
    assert found.host == ("0.0.0.0" if service.target == "server" or service.name == "parser" else "127.0.0.1")


def test_the_api_finds_the_parser_and_both_share_a_secret_that_no_other_service_has() -> None:
    api, parser = ALL["api"], ALL["parser"]
    assert api.environment["MAREY_TEXT_URL"] == f"http://parser:{parser.environment['MAREY_PORT']}"
    assert {name for name, service in ALL.items() if "text_key" in service.secrets} == {"api", "parser"}
    assert parser.secrets == ["text_key"]
    assert parser.raw["networks"] == ["back"]
    assert "ports" not in parser.raw


def test_every_secret_is_drawn_and_used(secrets: dict[str, str]) -> None:
    declared = read_compose()["secrets"]
    assert {name: entry["file"] for name, entry in declared.items()} == {
        name: f"deploy/secrets/{name}" for name in declared
    }
    assert set(declared) <= set(secrets)
    assert {name for service in ALL.values() for name in service.secrets} == set(declared)
    assert {file for service in ALL.values() for file in service.raw.get("env_file", [])} == {
        f"deploy/secrets/{name}" for name in set(secrets) - set(declared)
    }


@each
def test_a_service_reads_the_secrets_it_is_given_and_no_other(service: Service) -> None:
    told = " ".join([*service.environment.values(), *map(str, service.raw.get("command", []))])
    assert set(re.findall(r"/run/secrets/(\w+)", told)) == set(service.secrets)


def test_whoever_is_stopped_gets_the_time_it_asks_for() -> None:
    work = worker.STOP_SECONDS + worker.KILL_SECONDS
    assert min(ALL[name].grace for name in ("text", "editor", "evaluator")) > work
    assert ALL["worker"].grace > max(children.STOP_SECONDS, live.STOP_SECONDS) > work
    assert ALL["scheduler"].grace > 2 * scheduler.STOP_SECONDS
    assert ALL["postgres"].raw["stop_signal"] == "SIGINT"


def test_limits_of_processor_time_and_threads_are_one_number() -> None:
    chosen = services({"MAREY_WORKER_CPUS": "7"})
    for service in chosen.values():
        if service.name in {"parser", "editor"}:  # one sentence or motion at a time fills one core
            assert str(service.raw["cpus"]) == service.environment["MAREY_THREADS"] == "1"
        elif service.ours and service.target == "worker":
            assert str(service.raw["cpus"]) == service.environment["MAREY_THREADS"] == "7"
