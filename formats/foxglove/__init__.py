"""Foxglove's messages, as protobuf or JSON."""
