"""`python -m multimodal_to` is `multimodal-to`."""

from multimodal_to.cli import main

main()
