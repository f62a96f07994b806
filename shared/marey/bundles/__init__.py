"""Model bundles: a folder with `manifest.json`, safetensors shards and a model card; never a pickle."""

from marey.bundles.bundle import Bundle
from marey.bundles.choose import choose_bundle, choose_evaluator, choose_live_bundle, named_by
from marey.bundles.find import BrokenBundle, Bundles, find_bundle, list_bundles, scan_bundles
from marey.bundles.manifest import BundleFile, BundleManifest, DataSource, TextSpec
from marey.bundles.writer import BundleWriter

__all__ = [
    "BrokenBundle",
    "Bundle",
    "BundleFile",
    "BundleManifest",
    "BundleWriter",
    "Bundles",
    "DataSource",
    "TextSpec",
    "choose_bundle",
    "choose_evaluator",
    "choose_live_bundle",
    "find_bundle",
    "list_bundles",
    "named_by",
    "scan_bundles",
]
