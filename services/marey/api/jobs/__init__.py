"""Jobs: submit, list, follow, operate."""
