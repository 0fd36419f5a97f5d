"""Readings of range sensors become scans."""
