"""A folder for a robot from its URDF, and what is still missing in one."""

from multimodal_to.robots.initialising import Made, init

__all__ = ["Made", "init"]
