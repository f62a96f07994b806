"""Import of MoMask's public checkpoints, of HumanML3D (`checkpoints/t2m`) or KIT-ML (`checkpoints/kit`).

    t2m_*/{opt.txt, model/latest.tar}                       masked transformer; its options name the RVQ-VAE
    rvq_*/{opt.txt, meta/{mean,std}.npy, model/net_best_fid.tar}
    tres_*/{opt.txt, model/net_best_fid.tar}                residual transformer, with shared or separate tables
    length_estimator/model/finest.tar

Numbers of heads stand in the options alone. Options, keys and normalisation: EricGuo5513/momask-codes (MIT). It has
never run on the public files: they were not available during development.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from marey.bundles import Bundle, DataSource
from marey.core.errors import InvalidFile, InvalidInput
from marey.importing import Download, Fields, ImportRequest, make_card, provenance, text_encoder_of
from marey.models.momask import names
from marey.models.momask.bundle import MODEL, Networks
from marey.models.momask.config import KIT, T2M, MoMaskConfig, TokenizerConfig, TransformerConfig
from marey.nn.bundling import write_generator

DATA_SETS = {"t2m": T2M, "kit": KIT}
DILATION_GROWTH, STRIDE = 3, 2
MAX_SIZE, MAX_COUNT = 8192, 64
"""Limits of widths, and of numbers of layers, levels and heads: options beyond them are damaged."""


@dataclass(frozen=True)
class Folder:
    """The parts of one public folder."""

    masked: Path  # checkpoints
    residual: Path
    tokenizer: Path
    length: Path

    @classmethod
    def find(cls, download: Download) -> Folder:
        """Find the parts.

        Raises:
            NotFound: one is missing.
            InvalidInput: there are several, so that it is not clear which to import.
        """
        masked = download.find("t2m_*/model/latest.tar", "t2m_*/model/net_best_fid.tar", what="the masked transformer")
        options = download.options(_options(masked))
        tokenizer = options.text("vq_name")
        if Path(tokenizer).name != tokenizer:
            raise InvalidFile(f"vq_name: {tokenizer[:80]!r} cannot be the name of a folder", where=options.where)
        return cls(
            masked,
            download.find("tres_*/model/net_best_fid.tar", "tres_*/model/latest.tar", what="the residual transformer"),
            download.find(f"{tokenizer}/model/net_best_fid.tar", what="the RVQ-VAE"),
            download.find("length_estimator/model/finest.tar", what="the length estimator"),
        )


def import_momask(request: ImportRequest) -> Bundle:
    """Write the bundle of a public folder.

    Raises:
        NotFound, InvalidInput: a part is missing, or there are several of one; or no text encoder is installed.
        InvalidFile: a part is damaged, foreign, of the other data set, or of another configuration.
    """
    download = Download(request.folder, inside=("checkpoints/t2m", "checkpoints/kit"))
    _check_one_data_set(download)
    folder = Folder.find(download)
    config = _read_config(download, folder)
    networks = Networks.build(config)
    names.tokenizer_names(config).fill(
        networks.tokenizer, download.checkpoint(folder.tokenizer).section("vq_model", "net")
    )
    names.masked_names(config).fill(
        networks.masked, download.checkpoint(folder.masked).section("t2m_transformer", "trans")
    )
    names.residual_names(config).fill(
        networks.residual, download.checkpoint(folder.residual).section("res_transformer")
    )
    names.length_names(config).fill(networks.length, download.checkpoint(folder.length).section("estimator"))
    statistics = download.statistics(folder.tokenizer.parent.parent / "meta", config.features)
    accounts = download.finish()
    with text_encoder_of(request, "clip-vit-b32") as text:
        card = make_card(request, accounts, about=ABOUT[config.name], normalisation=NORMALISATION, text=text)
        return write_generator(
            request.output, MODEL, config, networks.states(), statistics, text=text, card=card, dtype=np.float32,
            overwrite=request.overwrite, licence=request.licence, training=provenance(request, accounts),
            data=(DataSource(**DATA[config.name], licence=request.licence),),
        )  # fmt: skip


def _check_one_data_set(download: Download) -> None:
    if download.root != download.folder and all((download.root.parent / name).is_dir() for name in DATA_SETS):
        raise InvalidInput(
            "holds the checkpoints of two data sets",
            where=str(download.root.parent),
            hint="Name one of its folders: t2m or kit.",
        )


def _read_config(download: Download, folder: Folder) -> MoMaskConfig:
    """Read the configuration from the options of all parts, which must belong together."""
    vq, masked, residual = (
        download.options(_options(part)) for part in (folder.tokenizer, folder.masked, folder.residual)
    )
    name = _data_set(download, masked)
    for fields in (vq, residual):
        fields.expect("dataset_name", name)
    residual.expect("vq_name", masked.text("vq_name"))
    tokenizer = _read_tokenizer(vq)
    known = DATA_SETS[name]
    for fields in (masked, residual):
        fields.expect("unit_length", tokenizer.frames_per_token)
    return replace(
        known,
        tokenizer=tokenizer,
        max_frames=masked.size("max_motion_length", known.max_frames, default=known.max_frames),
        masked=_read_transformer(masked),
        residual=_read_transformer(residual),
        shared=residual.flag("share_weight"),
    )


def _data_set(download: Download, masked: Fields) -> str:
    """Return the data set that the options name, which is that of the folder, where this has such a name."""
    masked.expect("dataset_name", *DATA_SETS)
    if download.root.name in DATA_SETS:
        masked.expect("dataset_name", download.root.name)
    return masked.text("dataset_name")


def _read_tokenizer(vq: Fields) -> TokenizerConfig:
    vq.expect("stride_t", STRIDE)
    vq.expect("dilation_growth_rate", DILATION_GROWTH)
    vq.expect("vq_act", "relu")
    vq.expect("vq_norm", "None")
    vq.expect("shared_codebook", False)
    code_width = vq.size("code_dim", MAX_SIZE)
    vq.expect("output_emb_width", code_width)
    return TokenizerConfig(
        width=vq.size("width", MAX_SIZE),
        depth=vq.size("depth", 8),
        stages=vq.size("down_t", 4),
        levels=vq.size("num_quantizers", MAX_COUNT, low=2),
        codes=vq.size("nb_code", 2 * MAX_SIZE),
        code_width=code_width,
    )


def _read_transformer(fields: Fields) -> TransformerConfig:
    width, heads = fields.size("latent_dim", MAX_SIZE), fields.size("n_heads", MAX_COUNT)
    if width % heads or width % 2:
        raise InvalidFile(f"n_heads: {heads} heads do not divide a width of {width}", where=fields.where)
    return TransformerConfig(fields.size("n_layers", MAX_COUNT), heads, width, fields.size("ff_size", MAX_SIZE))


def _options(checkpoint: Path) -> Path:
    return checkpoint.parent.parent / "opt.txt"


DATA = {
    "t2m": {"name": "HumanML3D", "credit": "Guo et al. 2022; made of AMASS and HumanAct12"},
    "kit": {"name": "KIT Motion-Language", "credit": "Plappert et al. 2016"},
}
NORMALISATION = """\
Mean and deviation of the RVQ-VAE's own `meta` folder. They differ from the data set's: the deviation of the root and of
foot contacts is divided by 5. Evaluators have their own."""
_ABOUT = """\
Guo et al. 2024, "MoMask: Generative Masked Modeling of 3D Human Motions", CVPR: the public checkpoints, trained on
{data}. The code is MIT; the weights have no stated terms, and those of the data do not allow commercial use.

A prompt is one vector of CLIP ViT-B/32, without the punctuation at its ends; the public code reads it with. A
motion is decoded at its own length, as the public code does with one prompt. Published on the test split with 10 steps
and guidance {guidance:g}: R@1 {top}, FID {fid}, measured with the T2M evaluator."""
ABOUT = {
    "t2m": _ABOUT.format(data="HumanML3D", guidance=4, top=".521", fid=".045"),
    "kit": _ABOUT.format(data="KIT Motion-Language", guidance=2, top=".433", fid=".204"),
}
