"""CARMEN's text logs, and those of CMU's Wean Hall."""
