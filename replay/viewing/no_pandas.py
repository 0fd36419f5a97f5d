"""Imported first by the process that draws: there pandas is not found, which saves half a second.

pyarrow, on which Rerun stands, imports pandas where it is there; we give it no frames of pandas. An
entry of None in `sys.modules` does not do: pyarrow's compiled imports may take it for the module.
"""

from __future__ import annotations

import sys
from importlib.abc import MetaPathFinder
from typing import Any


class NoPandas(MetaPathFinder):
    """Says of pandas, before others are asked, that it is not there."""

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> None:
        """Nothing to say of other modules.

        Raises:
            ModuleNotFoundError: of pandas.
        """
        if fullname.partition(".")[0] == "pandas":
            raise ModuleNotFoundError(f"No module named {fullname!r}", name=fullname)


sys.meta_path.insert(0, NoPandas())
