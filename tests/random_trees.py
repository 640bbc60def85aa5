"""Random robots as URDF text, seeded: all joint types, branches, fixed and massless links, axes straight and askew."""

from __future__ import annotations

import numpy as np

KINDS = ("revolute", "continuous", "prismatic", "fixed")


def random_urdf(bodies: int, seed: int, mimics: float = 0.0) -> str:
    """Return a robot of `bodies` links; a third of the joints have axes and frames at right angles, as real ones do.

    A share `mimics` of the joints follow others, on any branch, before or after them, or followers themselves.
    """
    rng = np.random.default_rng(seed)
    parents = [int(rng.integers(max(0, index - 4), index)) for index in range(1, bodies)]
    parts = ['<robot name="random">', _link("link0", rng)]
    for index, parent in enumerate(parents, start=1):
        massless = index in parents and rng.random() < 0.15  # never at a tip: a joint has to move something
        parts.append(f'<link name="link{index}"/>' if massless else _link(f"link{index}", rng))
        parts.append(_joint(index, parent, rng))
    if mimics:
        parts = _with_mimics(parts, mimics, rng)
    return "\n".join([*parts, "</robot>"])


def _with_mimics(parts: list[str], share: float, rng: np.random.Generator) -> list[str]:
    movable = [index for index, part in enumerate(parts) if part.startswith("<joint") and 'type="fixed"' not in part]
    order = rng.permutation(movable)
    for place in range(1, len(order)):
        if rng.random() < share:
            leader = parts[order[rng.integers(place)]].split('"')[1]  # earlier in the order, so that there is no circle
            multiplier, offset = rng.choice([-1.0, 1.0, rng.uniform(-2, 2)]), rng.choice([0.0, rng.uniform(-1, 1)])
            mimic = f'<mimic joint="{leader}" multiplier="{multiplier:.17g}" offset="{offset:.17g}"/></joint>'
            parts[order[place]] = parts[order[place]].replace("</joint>", mimic)
    return parts


def _text(values: np.ndarray) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def _link(name: str, rng: np.random.Generator) -> str:
    """Return a link whose inertia is that of a cloud of points, so that a body can have it."""
    points = rng.normal(size=(6, 3)) * rng.uniform(0.02, 0.2, 3)
    points -= points.mean(axis=0)
    mass = rng.uniform(0.1, 5)
    spread = points.T @ points * mass / 6
    inertia = np.trace(spread) * np.eye(3) - spread
    entries = " ".join(f'i{"xyz"[i]}{"xyz"[j]}="{inertia[i, j]:.17g}"' for i in range(3) for j in range(i, 3))
    return (
        f'<link name="{name}"><inertial><origin xyz="{_text(rng.normal(size=3) * 0.1)}" '
        f'rpy="{_text(rng.uniform(-3, 3, 3))}"/><mass value="{mass:.17g}"/><inertia {entries}/></inertial></link>'
    )


def _joint(index: int, parent: int, rng: np.random.Generator) -> str:
    kind = KINDS[rng.choice(4, p=[0.45, 0.1, 0.3, 0.15])]
    if rng.random() < 1 / 3:
        rpy = rng.integers(-2, 3, 3) * np.pi / 2
        axis = np.roll([1.0, 0.0, 0.0], rng.integers(3)) * rng.choice([-1, 1])
    else:
        rpy, axis = rng.uniform(-3, 3, 3), rng.normal(size=3)
        axis /= np.linalg.norm(axis)
    return (
        f'<joint name="joint{index}" type="{kind}"><parent link="link{parent}"/><child link="link{index}"/>'
        f'<origin xyz="{_text(rng.normal(size=3) * 0.2)}" rpy="{_text(rpy)}"/><axis xyz="{_text(axis)}"/>'
        '<limit lower="-1" upper="1" effort="10" velocity="10"/></joint>'
    )
