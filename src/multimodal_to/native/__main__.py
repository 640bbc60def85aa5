"""`python -m multimodal_to.native`: compile the library anew, in its place; silent unless it fails."""

from __future__ import annotations

import sys

from multimodal_to.native import compiling
from multimodal_to.native.library import BESIDE

if __name__ == "__main__":
    try:
        compiling.build(BESIDE)
    except compiling.BuildError as error:
        sys.exit(f"the native library was not built: {error}")
