"""One import: known kinds, the licence, the output, all checked before anything is read; and the generated card."""

from __future__ import annotations

from pathlib import Path

import pytest

from marey.bundles import TextSpec
from marey.core.errors import Conflict, InvalidInput, NotFound, PluginError
from marey.importing import Account, ImportRequest, make_card, provenance, run_import
from marey.registry import ImportKind, import_kinds
from marey.registry import models as registry
from tests.support.marey import REPOSITORY

RUNS: list[ImportRequest] = []


def record(request: ImportRequest) -> None:
    RUNS.append(request)


PLAIN = ImportKind("plain", "Plain weights.", "tests.unit.importing.test_request:record", licence="MIT")
UNLICENSED = ImportKind("unlicensed", "No terms.", "tests.unit.importing.test_request:record", text_encoder=True)


@pytest.fixture(autouse=True)
def kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    RUNS.clear()
    monkeypatch.setattr("marey.importing.request.import_kinds", lambda: {k.name: k for k in (PLAIN, UNLICENSED)})


def test_an_unknown_kind_lists_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="unknown kind 'other'") as caught:
        run_import("other", tmp_path, tmp_path / "out")
    assert "plain" in str(caught.value.hint)
    assert "No terms." in str(caught.value.hint)


def test_the_licence_is_the_kind_s_unless_one_is_given_and_is_needed(tmp_path: Path) -> None:
    run_import("plain", tmp_path, tmp_path / "out")
    run_import("plain", tmp_path, tmp_path / "out", licence="CC-BY-4.0")
    run_import("unlicensed", tmp_path, tmp_path / "out", licence="LicenseRef-Mine-NC", text_encoder=tmp_path)
    assert [each.licence for each in RUNS] == ["MIT", "CC-BY-4.0", "LicenseRef-Mine-NC"]
    assert RUNS[2] == ImportRequest(
        "unlicensed", tmp_path, tmp_path / "out", "LicenseRef-Mine-NC", text_encoder=tmp_path
    )
    with pytest.raises(InvalidInput, match="states no licence") as caught:
        run_import("unlicensed", tmp_path, tmp_path / "out")
    assert caught.value.argument == "licence"
    with pytest.raises(InvalidInput, match="invalid licence 'do what you want'"):
        run_import("plain", tmp_path, tmp_path / "out", licence="do what you want")


def test_an_existing_bundle_is_kept_unless_it_is_to_be_replaced(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(Conflict, match="already exists") as caught:
        run_import("plain", tmp_path, tmp_path / "out")
    assert caught.value.argument == "overwrite"
    assert not RUNS
    run_import("plain", tmp_path, tmp_path / "out", overwrite=True)
    assert RUNS[0].overwrite


def test_a_name_that_no_bundle_can_have_and_an_unread_text_encoder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="cannot be the name of a bundle"):
        run_import("plain", tmp_path, tmp_path / ".hidden")
    with pytest.raises(InvalidInput, match="reads no text encoder"):
        run_import("plain", tmp_path, tmp_path / "out", text_encoder=tmp_path)
    assert not RUNS


def test_kinds_are_those_of_models_and_those_registered_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    found = import_kinds()
    assert {"t2m-evaluator", "snapmogen-evaluator", "allennlp-srl", "clip-vit-b32", "t5-v1_1-base"} <= set(found)
    assert list(found) == sorted(found)
    spec = registry.ModelSpec("sway", "Sway", "Sways.", "a:b", "a:b", imports=(PLAIN,))
    monkeypatch.setattr(registry.MODELS, "all", lambda: {"sway": spec})
    assert import_kinds()["plain"] is PLAIN
    twice = ImportKind("t2m-evaluator", "Another.", "a:b")
    spec = registry.ModelSpec("sway", "Sway", "Sways.", "a:b", "a:b", imports=(twice,))
    monkeypatch.setattr(registry.MODELS, "all", lambda: {"sway": spec})
    with pytest.raises(PluginError, match="two kinds of import have the name 't2m-evaluator'"):
        import_kinds()


def test_the_card_lists_files_tensors_and_what_was_left_out() -> None:
    request = ImportRequest("plain", Path("in"), Path("models/out"), "MIT")
    ignored = {"opt": "state of an optimizer", "pe.a": "computed anew", "pe.b": "computed anew"}
    accounts = [Account("model/net.tar", 1234567, "ab" * 32, ("model.x", "model.y"), ignored)]
    text = TextSpec(encoder="clip-vit-b32", encoder_sha256="cd" * 32, width=512)
    card = make_card(request, accounts, about="A paper.", normalisation="Of `meta`.", text=text)
    assert f"| `model/net.tar` | 1,234,567 | `{'ab' * 32}` | 2 |" in card
    assert "- `model/net.tar`: `opt`: state of an optimizer." in card
    assert "- `model/net.tar`: `pe.a` and 1 more: computed anew." in card
    for part in ("# out, imported", "A paper.", "marey models import plain", "MIT", "Of `meta`.", "clip-vit-b32"):
        assert part in card
    assert provenance(request, accounts)["files"] == [
        {"file": "model/net.tar", "bytes": 1234567, "sha256": "ab" * 32, "tensors": 2}
    ]


def test_the_page_lists_every_registered_kind() -> None:
    page = (REPOSITORY / "docs" / "how-to" / "import-weights.md").read_text(encoding="utf-8")
    assert not [name for name in import_kinds() if f"`{name}`" not in page]
