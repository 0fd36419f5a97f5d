"""Many logs and their results: batch, rescore, compare."""
