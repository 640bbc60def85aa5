"""The C library that comes with the package: how it is compiled, found and opened."""

from multimodal_to.native.library import instruction_set, library, library_file, missing

__all__ = ["instruction_set", "library", "library_file", "missing"]
