"""Depth images and clouds become scans."""
