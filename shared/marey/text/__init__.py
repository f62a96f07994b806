"""From a prompt to what a generator reads: semantic graph, role labels, encodings (HGM³ Sec. 3.3)."""
