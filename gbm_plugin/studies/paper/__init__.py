"""The figures of the paper, and beyond them."""
