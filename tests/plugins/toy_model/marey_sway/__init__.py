"""A model that stands and sways: the smallest that is served, trained and bundled."""
