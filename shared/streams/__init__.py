"""Frames of live streams: their bytes, and the streams on Redis that carry them from a worker to any API process."""
