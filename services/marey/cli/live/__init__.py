"""Parts of `marey stream`: following, typed lines, the status line, rate and latency."""
