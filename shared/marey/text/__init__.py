"""Text pipeline: semantic graph, role labels and encodings of a prompt (HGM³ Sec. 3.3)."""
