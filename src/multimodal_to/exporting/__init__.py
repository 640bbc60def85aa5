"""Motions for other programs."""
