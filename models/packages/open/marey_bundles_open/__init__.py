"""Bundles for Marey under CC BY-SA 4.0; found through the entry-point group `marey.bundles`."""
