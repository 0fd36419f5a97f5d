"""Verbs: what one does with logs, plans and results."""
