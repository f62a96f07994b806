"""A bundle of HGM³ with matrices in 8 bits."""

from __future__ import annotations

from pathlib import Path

import torch

from marey.bundles.eight_bit import write_eight_bit
from marey.models.hgm3.bundle import load_networks, random_bundle


def test_the_networks_have_the_weights_to_a_hundredth(tmp_path: Path) -> None:
    bundle = random_bundle(tmp_path / "bundle", "starter")
    copy = write_eight_bit(bundle, tmp_path / "copy")
    sizes = [sum(entry.bytes for entry in each.manifest.files.values()) for each in (copy, bundle)]
    assert sizes[0] < 0.62 * sizes[1]
    (_, before), (_, after) = load_networks(bundle), load_networks(copy)
    for name, network in before.parts().items():
        restored = dict(after.parts()[name].named_parameters())
        for key, weight in network.named_parameters():
            assert (restored[key] - weight).abs().max() <= 0.005 * weight.abs().max() + 1e-7, (name, key)
    assert torch.equal(before.tokenizer.quantizer.codebooks, after.tokenizer.quantizer.codebooks)
