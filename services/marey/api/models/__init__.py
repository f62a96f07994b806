"""Models: the bundles that items can be made with."""
