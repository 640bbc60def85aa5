"""matplotlib, imported first here: what its settings say wrong is one sentence. Figures need no backend."""

from __future__ import annotations

import os

from multimodal_to.errors import InputError, shown

try:
    import matplotlib as matplotlib
except ValueError as error:  # the environment names a backend that it does not know
    raise InputError(
        f"matplotlib does not start: MPLBACKEND is {shown(os.environ.get('MPLBACKEND', ''))}; expected a backend that "
        "it knows, such as 'agg', or none"
    ) from error
