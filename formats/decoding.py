"""Payload -> noun: which module reads what a topic is encoded as."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from formats.log import Topic
from formats.payload import Payload

# Encoding -> modules with DECODERS, by type, and decoder(topic); the first that has the type reads.
ENCODINGS = {
    "ros1": ("formats.ros.decoders",),
    "cdr": ("formats.ros.decoders",),
    "protobuf": ("formats.foxglove.decoders",),
    "json": ("formats.foxglove.decoders", "formats.ros.as_json"),
    "carmen": ("formats.carmen.nouns",),
}


def decoder_of(topic: Topic) -> Callable[[Payload], Any] | None:
    """What reads the payloads of a topic, None where nothing does; it raises Undecodable."""
    for module in map(import_module, ENCODINGS.get(topic.encoding, ())):
        if topic.type in module.DECODERS:
            read: Callable[[Payload], Any] = module.decoder(topic)
            return read
    return None
