"""Import public weights once, offline: pickled checkpoints become safetensors, MiniLM a bundle in 8 bits.

No other code here reads pickle.

    python -m marey.text.convert bert-srl ARCHIVE.tar.gz --bert FOLDER -o models/srl-bert
    python -m marey.text.convert encoder FOLDER
    python -m marey.text.convert minilm FOLDER -o models/minilm-l6

`--bert` names a folder with the `config.json` and `vocab.txt` of bert-base-uncased: the archive only names the model.
Checkpoints are read with `weights_only=True`, which refuses anything but tensors.
"""

from __future__ import annotations

import argparse
import io
import json
import pickle
import sys
import tarfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, cast

import torch
from safetensors.torch import save_file  # pyright: ignore[reportUnknownVariableType]

from marey.bundles import Bundle, BundleWriter, DataSource
from marey.core.characters import escape
from marey.core.errors import InvalidFile, MareyError
from marey.text.bert_srl import PREFIX, PROJECTION
from marey.text.minilm_bundle import import_minilm
from marey.text.pretrained import read_config

ARCHIVE_FILES = ("config.json", "weights.th", "vocabulary/labels.txt")


def import_bert_srl(archive: Path, bert: Path, output: Path) -> Bundle:
    """Convert an AllenNLP SRL archive to a labeller bundle.

    Args:
        archive: the `.tar.gz`, or a folder it was unpacked to.
        bert: folder with `config.json` and `vocab.txt` of the BERT it was trained from.
        output: the bundle's folder.

    Raises:
        InvalidFile: the archive is broken, foreign, or of another BERT.
    """
    files = _read_folder(archive) if archive.is_dir() else _read_tar(archive)
    reader = json.loads(files["config.json"]).get("dataset_reader", {})
    named = str(reader.get("bert_model_name", ""))
    config = read_config(bert)
    keep = ("vocab_size", "hidden_size", "num_hidden_layers", "num_attention_heads", "intermediate_size")
    keep += ("max_position_embeddings", "type_vocab_size", "hidden_act", "layer_norm_eps")
    weights = _tensors(files["weights.th"], archive)
    tensors = {
        name: value.float().numpy()
        for name, value in weights.items()
        if name.startswith((PREFIX, PROJECTION)) and ".pooler." not in name and not name.endswith("position_ids")
    }
    if f"{PROJECTION}weight" not in tensors or len(tensors) < 3:
        raise InvalidFile("is not a BERT role labeller", where=str(archive), hint="See the top of this module.")
    with BundleWriter(output) as writer:
        writer.add_part("srl", tensors)
        writer.add_card(CARD.format(name=named))
        return writer.finish(
            name=output.name,
            version="1",
            kind="labeller",
            model="bert-srl",
            config=named or "bert",
            parameters={
                "labels": files["vocabulary/labels.txt"].decode("utf-8").rstrip("\n").split("\n"),
                "vocabulary": (bert / "vocab.txt").read_text(encoding="utf-8").rstrip("\n").split("\n"),
                "lowercase": "uncased" in named,
                "bert": {key: config[key] for key in keep if key in config},
            },
            data=(DataSource(name="OntoNotes 5.0", licence="LDC", credit="AllenNLP, Shi & Lin 2019"),),
            licence="Apache-2.0",
        )


def convert_encoder(folder: Path) -> Path:
    """Write `model.safetensors` beside a folder's `pytorch_model.bin`.

    Raises:
        InvalidFile: there is no such file, or it holds more than tensors.
    """
    source = folder / "pytorch_model.bin"
    target = folder / "model.safetensors"
    try:
        weights = _tensors(source.read_bytes(), source)
    except OSError as error:
        raise InvalidFile(f"cannot be read: {error}", where=str(source)) from error
    save_file({name: value.clone().contiguous() for name, value in weights.items()}, target, metadata={"format": "pt"})
    return target


def _tensors(content: bytes, where: Path) -> Mapping[str, torch.Tensor]:
    try:
        loaded: Any = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, ValueError) as error:
        raise InvalidFile(
            f"its weights cannot be read safely: {error}", where=str(where), hint="Download it again."
        ) from error
    tensors: Mapping[str, object] = cast("Mapping[str, object]", loaded) if isinstance(loaded, Mapping) else {}
    if not tensors or not all(isinstance(value, torch.Tensor) for value in tensors.values()):
        raise InvalidFile("does not hold a dictionary of tensors", where=str(where))
    return cast("Mapping[str, torch.Tensor]", tensors)


def _read_folder(folder: Path) -> dict[str, bytes]:
    missing = [name for name in ARCHIVE_FILES if not (folder / name).is_file()]
    if missing:
        raise InvalidFile(f"lacks {', '.join(missing)}", where=str(folder), hint="Is it an AllenNLP archive?")
    return {name: (folder / name).read_bytes() for name in ARCHIVE_FILES}


def _read_tar(archive: Path) -> dict[str, bytes]:
    try:
        with tarfile.open(archive) as tar:
            found = {member.name.removeprefix("./"): member for member in tar.getmembers() if member.isfile()}
            return {name: cast("IO[bytes]", tar.extractfile(found[name])).read() for name in ARCHIVE_FILES}
    except KeyError as error:
        raise InvalidFile(f"lacks {error}", where=str(archive), hint="Is it an AllenNLP archive?") from error
    except (OSError, tarfile.TarError, EOFError) as error:
        raise InvalidFile(f"is not a readable archive: {error}", where=str(archive)) from error


CARD = """# Role labeller imported from AllenNLP

`structured-prediction-srl-bert` ({name}), Shi & Lin 2019, converted to safetensors by `python -m marey.text.convert`.
Trained by AllenNLP on OntoNotes 5.0. Predicates come from the `light` labeller, not from spaCy.
"""


def main(arguments: list[str] | None = None) -> int:
    """The command line of this module; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m marey.text.convert", description=__doc__.split("\n")[0])  # pyright: ignore[reportOptionalMemberAccess]
    commands = parser.add_subparsers(dest="command", required=True)
    srl = commands.add_parser("bert-srl", help="an AllenNLP SRL archive to a labeller bundle")
    srl.add_argument("archive", type=Path)
    srl.add_argument("--bert", type=Path, required=True, help="folder with config.json and vocab.txt")
    srl.add_argument("-o", "--output", type=Path, required=True)
    encoder = commands.add_parser("encoder", help="pytorch_model.bin to model.safetensors")
    encoder.add_argument("folder", type=Path)
    minilm = commands.add_parser("minilm", help="all-MiniLM-L6-v2 to a bundle in 8 bits")
    minilm.add_argument("folder", type=Path, help="folder with its model.safetensors and tokenizer.json")
    minilm.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args(arguments)
    try:
        if options.command == "bert-srl":
            made = import_bert_srl(options.archive, options.bert, options.output).path
        elif options.command == "minilm":
            made = import_minilm(options.folder, options.output).path
        else:
            made = convert_encoder(options.folder)
    except MareyError as error:
        sys.stderr.write(f"{escape(str(error))}\n")
        return error.exit_code
    sys.stdout.write(f"{made}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
