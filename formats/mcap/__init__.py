"""MCAP: logs read and written at the level of their bytes (mcap.dev/spec)."""
