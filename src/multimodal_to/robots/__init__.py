"""A folder for a robot from its URDF, and what is missing or odd in one; `robots.picture` draws a robot at home."""

from multimodal_to.robots.checking import Check, check
from multimodal_to.robots.initialising import Made, init

__all__ = ["Check", "Made", "check", "init"]
