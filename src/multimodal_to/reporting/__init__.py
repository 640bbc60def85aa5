"""What a person reads of a solve: a page, tables beside the paper's figures, and the bundled scenarios solved again."""
