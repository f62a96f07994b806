"""Import AllenNLP's role labeller (`structured-prediction-srl-bert`, Shi & Lin 2019) as a bundle of `bert-srl`.

    marey models import allennlp-srl ARCHIVE.tar.gz -o models/srl-bert --text-encoder bert-base-uncased

The archive, or the folder that it unpacks to, names its BERT only: `--text-encoder` is a folder with the `config.json`
and `vocab.txt` of bert-base-uncased.
"""

from __future__ import annotations

import re
import shutil
import tarfile
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from marey.bundles import Bundle, BundleWriter, DataSource
from marey.core.documents import read_bytes, read_json
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.core.hashing import sha256_of
from marey.importing.card import make_card, provenance
from marey.importing.checkpoint import Account, Checkpoint
from marey.importing.fields import Fields
from marey.importing.request import ImportRequest
from marey.importing.torch_files import MAX_BYTES
from marey.text.bert_srl import PREFIX, PROJECTION
from marey.text.pretrained import read_config

CONFIG, WEIGHTS, LABELS = "config.json", "weights.th", "vocabulary/labels.txt"
KEPT = (
    "vocab_size", "hidden_size", "num_hidden_layers", "num_attention_heads", "intermediate_size",
    "max_position_embeddings", "type_vocab_size", "hidden_act", "layer_norm_eps",
)  # fmt: skip
"""Fields of BERT's configuration that the labeller is built from."""
MAX_LINES_BYTES = 2**24


@dataclass(frozen=True)
class _Bert:
    """Configuration and vocabulary of the BERT that the labeller was trained from."""

    config: dict[str, Any]
    vocabulary: list[str]


def import_allennlp(request: ImportRequest) -> Bundle:
    """Import an archive of AllenNLP's role labeller.

    Args:
        request: its folder is the `.tar.gz`, or the folder that it was unpacked to.

    Raises:
        NotFound: the archive, a file of it, or BERT's folder is missing.
        InvalidFile: a file is damaged, foreign, or of another BERT.
        InvalidInput: no folder of BERT is named.
        Conflict: the bundle already exists.
    """
    bert = _read_bert(request)
    with _unpacked(request.folder, request.output.parent) as folder:
        named = _bert_name(folder / CONFIG)
        labels = _lines(folder / LABELS)
        tensors, account = _read_weights(folder / WEIGHTS, bert, len(labels))
    account = _of_archive(account, request.folder)
    with BundleWriter(request.output, overwrite=request.overwrite) as writer:
        writer.add_part("srl", tensors)
        writer.add_card(make_card(request, [account], about=ABOUT.format(name=named or "bert")))
        return writer.finish(
            name=request.output.name,
            version="1",
            kind="labeller",
            model="bert-srl",
            config=named or "bert",
            parameters={
                "labels": labels,
                "vocabulary": bert.vocabulary,
                "lowercase": "uncased" in named,
                "bert": {key: bert.config[key] for key in KEPT if key in bert.config},
            },
            data=(DataSource(name="OntoNotes 5.0", licence="LDC", credit="AllenNLP, Shi & Lin 2019"),),
            licence=request.licence,
            training=provenance(request, [account]),
        )


def _read_weights(file: Path, bert: _Bert, labels: int) -> tuple[dict[str, Any], Account]:
    checkpoint = Checkpoint.open(file, shown=WEIGHTS)
    section = checkpoint.whole()
    section.ignore(rf"{re.escape(PREFIX)}pooler\..*", "the pooled state, which is not read")
    section.ignore(r".*position_ids", "computed anew")
    width = Fields(CONFIG, bert.config).integer("hidden_size")
    shapes = {f"{PROJECTION}weight": (labels, width), f"{PROJECTION}bias": (labels,)}
    shapes |= {name: section.shape(name) for name in _bert_names(bert)}
    found = {name: section.take(name, shape).numpy() for name, shape in shapes.items()}
    return found, checkpoint.finish()


def _bert_names(bert: _Bert) -> list[str]:
    """Return the names of BERT's tensors in the archive, but for the pooled state."""
    from transformers import BertConfig, BertModel

    with torch.device("meta"):
        model = BertModel(BertConfig(**{k: bert.config[k] for k in KEPT if k in bert.config}), add_pooling_layer=False)
    return [f"{PREFIX}{name}" for name in model.state_dict()]


def _read_bert(request: ImportRequest) -> _Bert:
    folder = request.text_encoder
    if folder is None:
        raise InvalidInput(
            "the archive only names its BERT",
            where="text_encoder",
            hint="Pass text_encoder: a folder with the config.json and vocab.txt of bert-base-uncased.",
            argument="text_encoder",
        )
    config = read_config(folder)
    if config.get("model_type", "bert") != "bert":
        raise InvalidFile("is not the configuration of a BERT", where=str(folder / CONFIG))
    vocabulary = _lines(folder / "vocab.txt")
    if len(vocabulary) != Fields(str(folder / CONFIG), config).integer("vocab_size"):
        raise InvalidFile(
            f"has {len(vocabulary)} lines, and its config.json names {config['vocab_size']}",
            where=str(folder / "vocab.txt"),
            hint="Take both files from one model.",
        )
    return _Bert(config, vocabulary)


def _bert_name(file: Path) -> str:
    document = read_json(file)
    reader = document.get("dataset_reader") if isinstance(document, dict) else None
    return str(reader.get("bert_model_name", "")) if isinstance(reader, dict) else ""


def _lines(file: Path) -> list[str]:
    try:
        return read_bytes(file, limit=MAX_LINES_BYTES).decode("utf-8").rstrip("\n").split("\n")
    except UnicodeDecodeError:
        raise InvalidFile("is not text", where=str(file)) from None


@contextmanager
def _unpacked(archive: Path, beside: Path) -> Generator[Path]:
    """Give the folder of the archive's three files; where it is packed, a temporary one in the folder `beside`."""
    if archive.is_dir():
        for name in (CONFIG, WEIGHTS, LABELS):
            if not (archive / name).is_file():
                raise NotFound(f"there is no {name}", where=str(archive), hint="Is it an AllenNLP archive?")
        yield archive
        return
    if not archive.exists():
        raise NotFound("there is no such file or folder", where=str(archive))
    beside.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".", dir=beside) as temporary:
        _unpack(archive, Path(temporary))
        yield Path(temporary)


def _unpack(archive: Path, folder: Path) -> None:
    try:
        with tarfile.open(archive) as tar:
            found = {member.name.removeprefix("./"): member for member in tar.getmembers() if member.isfile()}
            for name in (CONFIG, WEIGHTS, LABELS):
                if name not in found:
                    raise NotFound(f"holds no {name}", where=str(archive), hint="Is it an AllenNLP archive?")
                source = tar.extractfile(found[name])
                if source is None or found[name].size > MAX_BYTES:
                    raise InvalidFile(f"its {name} is over {MAX_BYTES:,} bytes", where=str(archive))
                (folder / name).parent.mkdir(exist_ok=True)
                with (folder / name).open("wb") as target:
                    shutil.copyfileobj(source, target)
    except (OSError, tarfile.TarError, EOFError) as error:
        raise InvalidFile(
            f"is not a readable archive: {error}", where=str(archive), hint="Download it again."
        ) from None


def _of_archive(account: Account, archive: Path) -> Account:
    """Return the account with name, size and hash of the archive, where the weights lay in one."""
    if archive.is_dir():
        return account
    return replace(account, file=archive.name, bytes=archive.stat().st_size, sha256=sha256_of(archive))


ABOUT = """AllenNLP's role labeller `structured-prediction-srl-bert` ({name}), Shi & Lin 2019, trained by AllenNLP on
OntoNotes 5.0. Predicates come from the labeller `light`, not from spaCy."""
