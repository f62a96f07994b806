"""Import the published weights of MoMask++: one of the two sets of its `checkpoint_dir` becomes a bundle.

    marey models import momaskpp FOLDER -o BUNDLE --text-encoder T5

FOLDER is `checkpoint_dir/snapmogen` or `checkpoint_dir/humanml3d`, or of several transformers in a set the folder of
one, `…/momask_plus/NAME`. SnapMoGen's statistics are the data set's: `meta_data`, in FOLDER or beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from marey.bundles import Bundle, DataSource
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.importing import Checkpoint, Download, Fields, ImportRequest, make_card, provenance, text_encoder_of
from marey.models.momaskpp.bundle import MODEL, ScaleNetworks
from marey.models.momaskpp.config import RELEASED_HUMANML3D, RELEASED_SNAPMOGEN, MoMaskPPConfig
from marey.models.momaskpp.released import MASKED, REFINER, TOKENIZER, UNUSED, Rule, renamed
from marey.nn.bundling import write_generator
from marey.text.wordings import Wording

ENCODER = "t5-v1_1-base"
INSIDE = ("checkpoint_dir",)
TRANSFORMERS = "momask_plus"
CREDIT = "Guo et al. 2025, SnapMoGen: Human Motion Generation from Expressive Texts"


@dataclass(frozen=True)
class PublishedSet:
    """One of the published sets.

    Attributes:
        name: of its folder in `checkpoint_dir`.
        config: of its networks; heads and the way to read the text come from the files.
        statistics: where mean and deviation lie, relative to its folder.
        data: the data set that it was trained on.
        normalisation: lines of the card.
        wording: of its training texts.
    """

    name: str
    config: MoMaskPPConfig
    statistics: tuple[str, ...]
    data: str
    normalisation: str
    wording: Wording = "caption"


SETS = (
    PublishedSet(
        "snapmogen",
        RELEASED_SNAPMOGEN,
        ("meta_data", "../meta_data", "../../meta_data", "../../../meta_data"),
        "SnapMoGen",
        "Mean and deviation of the data set's `meta_data`, all 296 features.",
        "description",
    ),
    PublishedSet(
        "humanml3d",
        RELEASED_HUMANML3D,
        ("Comp_v6_KLD005/meta",),
        "HumanML3D",
        "Mean and deviation of the published evaluator (`Comp_v6_KLD005/meta`), which these weights were trained with.",
    ),
)


def import_momaskpp(request: ImportRequest, sets: Sequence[PublishedSet] = SETS) -> Bundle:
    """Import one set of weights.

    Args:
        request: the import.
        sets: other sizes, for tests; the published ones by default.

    Raises:
        NotFound: a file, or the text encoder, is missing.
        InvalidFile: a file is damaged, of another kind, or of other sizes.
        InvalidInput: the folder holds both sets, or a set holds several transformers.
        Conflict: the bundle already exists.
    """
    chosen = request.folder if request.folder.absolute().parent.name == TRANSFORMERS else None
    download = Download(request.folder if chosen is None else chosen.absolute().parents[1], inside=INSIDE)
    published, folder = _set_of(download, sets)
    transformer = chosen.absolute() if chosen is not None else _transformer(folder)
    config, networks = _networks(download, published, folder, transformer)
    where = download.find(*published.statistics, what="the statistics", within=folder)
    statistics = download.statistics(where, config.features)
    accounts = download.finish()
    with text_encoder_of(request, ENCODER) as spec:
        text = spec.model_copy(update={"wording": published.wording})
        return write_generator(
            request.output,
            MODEL,
            config,
            networks.states(),
            statistics,
            text=text,
            card=make_card(request, accounts, about=ABOUT, normalisation=published.normalisation, text=text),
            overwrite=request.overwrite,
            dtype=np.float32,
            licence=request.licence,
            data=(DataSource(name=published.data, licence=request.licence, credit=CREDIT),),
            training=provenance(request, accounts),
        )


def _set_of(download: Download, sets: Sequence[PublishedSet]) -> tuple[PublishedSet, Path]:
    """Return the set that a folder holds, or is, and its folder."""
    root = download.root
    found = [(each, root / each.name) for each in sets if (root / each.name / "vq").is_dir()]
    if not found and (root / "vq").is_dir():
        found = [(each, root) for each in sets if root.absolute().name == each.name]
    names = [each.name for each in sets]
    if not found:
        raise NotFound(
            f"holds neither {' nor '.join(names)}",
            where=str(root),
            hint=f"Name the folder `checkpoint_dir/{names[0]}` of the download, with `vq` and `{TRANSFORMERS}` in it.",
        )
    if len(found) > 1:
        raise InvalidInput(
            f"holds {' and '.join(each.name for each, _ in found)}",
            where=str(root),
            hint=f"A bundle is made of one of them: name {found[0][1]}, for instance.",
        )
    return found[0]


def _transformer(folder: Path) -> Path:
    """Return the only transformer of a set."""
    found = sorted(path for path in (folder / TRANSFORMERS).glob("*") if path.is_dir())
    if not found:
        raise NotFound("the transformer is missing", where=str(folder / TRANSFORMERS), hint="Download the set again.")
    if len(found) > 1:
        raise InvalidInput(
            f"holds several transformers: {', '.join(path.name for path in found)}",
            where=str(folder / TRANSFORMERS),
            hint=f"Name the folder of one instead, such as {found[0]}.",
        )
    return found[0]


def _networks(
    download: Download, published: PublishedSet, folder: Path, transformer: Path
) -> tuple[MoMaskPPConfig, ScaleNetworks]:
    """Read all networks of a set, with the configuration that they have."""
    yaml = download.find("vq/*/residual_vqvae*.yaml", what="the configuration of the tokenizer", within=folder)
    download.note(yaml)
    tokenizer = download.find(
        *(f"model/{name}.tar" for name in ("net_best_mpjpe", "net_best_fid", "latest")),
        what="the tokenizer",
        within=yaml.parent,
    )
    yaml = download.find("train_momaskplus*.yaml", what="the configuration of the transformer", within=transformer)
    file = download.find(
        *(f"model/{name}.tar" for name in ("net_best_fid", "latest", "net_best_acc")),
        what="the transformer",
        within=transformer,
    )
    masked = download.checkpoint(file).section("t2m_transformer")
    cross = any(".multihead_attn." in name for name in masked.names)
    config = replace(
        published.config,
        masked=replace(published.config.masked, conditioning="cross-attention" if cross else "in-context"),
    )
    config = _with_heads(config, download.yaml(yaml))
    refiner = sorted(folder.glob("gmr/*/model/best.tar"))
    if not refiner:
        config = replace(config, refiner=replace(config.refiner, width=0))
    networks = ScaleNetworks.build(config)
    _fill(download.checkpoint(tokenizer), ("vq_model", "model"), networks.tokenizer, TOKENIZER)
    _fill(download.checkpoint(file), ("t2m_transformer",), networks.masked, MASKED)
    if networks.refiner is not None:
        _fill(download.checkpoint(refiner[0]), ("regressor",), networks.refiner, REFINER)
    return config, networks


def _fill(checkpoint: Checkpoint, keys: Sequence[str], network: nn.Module, rules: Sequence[Rule]) -> None:
    """Fill a network with the tensors under the first of `keys`."""
    section = checkpoint.section(*keys)
    section.ignore(UNUSED.pattern, "computed anew, of an option that is off, or of the text encoder")
    read = {name: section.take(name) for name in section.names if not UNUSED.fullmatch(name)}
    tensors = renamed(read, rules, section.where)
    own = network.state_dict()
    if unknown := sorted(set(tensors) - set(own)):
        raise InvalidFile(
            f"holds tensors that this network does not have, such as {unknown[0]}",
            where=section.where,
            hint="These are weights of another configuration.",
        )
    section.fill(network, made=_kept(own) | tensors)


def _kept(own: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return what a published file lacks: text states are read as they are, and the codebook is in use."""
    kept = {name: value for name, value in own.items() if ".normalizer." in name}
    kept |= {name: torch.ones_like(value) for name, value in own.items() if name == "quantizer.counts"}
    return kept | {name: torch.tensor(True) for name in own if name == "quantizer.initialized"}


def _with_heads(config: MoMaskPPConfig, fields: Fields) -> MoMaskPPConfig:
    """Return the configuration with the number of attention heads of the file, which no tensor's shape tells.

    Raises:
        InvalidFile: none, several numbers, or one that does not divide the width.
    """
    found = sorted({value for value in fields.search(r"n(um)?_?heads?").values() if isinstance(value, int)})
    if len(found) != 1 or found[0] < 1 or config.masked.width % found[0]:
        raise InvalidFile(
            f"its number of heads cannot be used: {found or 'none'}",
            where=fields.where,
            hint="Is it the file that came with the weights? Download it again.",
        )
    return replace(config, masked=replace(config.masked, heads=found[0]))


ABOUT = """MoMask++ (Guo et al. 2025) with published weights: a multi-scale tokenizer and one masked transformer that
reads a prompt word by word. The weights may be used for non-commercial research alone.

Networks, tokens and logits equal those of the published code to 1e-4 on its sizes; compare figures of your own with
Tables 2 and 3 of the paper before you rely on them. Long, literal descriptions of the movement work best. Without a
given length a motion has one of three lengths, by its seed."""
