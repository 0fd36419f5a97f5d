"""The mapper: frames -> evidence. It knows no prior, no probability and no file."""

from __future__ import annotations

from typing import Any

from formats.frame import Frame
from formats.grid import Evidence, Geometry
from replay.sensors.observer import MODELS, Model, Touched
from replay.sensors.polar import observer


class Mapper:
    """Counts, reading by reading, what every cell was shown at.

    Args:
        geometry: of the map, in the plan's frame.
        model: a sensor model or its name in MODELS.
        options: of `sensor.Observer`: max_range, no_return, margin, min_observed, shape.

    Attributes:
        evidence: what was seen so far; unseen pages of it are not resident.
        observe: the model at work.
    """

    def __init__(self, geometry: Geometry, model: str | Model = "beam", **options: Any) -> None:
        self.model = MODELS[model] if isinstance(model, str) else model
        self.evidence = Evidence.empty(geometry, self.model.levels)
        self.observe = observer(geometry, self.model, **options)

    def insert(self, frame: Frame) -> Touched:
        """Count a reading whose pose is in the frame of the map.

        Returns:
            the cells that it showed, each once, and at which level; valid until the next call.
        """
        return self.observe(frame.pose, frame.scan, self.evidence.counts)
