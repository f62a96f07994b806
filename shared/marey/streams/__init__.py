"""Live streams: bytes of a frame, the streams on Redis that carry frames to any API process, messages, recordings."""
