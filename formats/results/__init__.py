"""The result of a run in one MCAP file: written, read back, re-scored."""
