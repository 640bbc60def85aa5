"""`Scenario`: a task as data. What is asked of the motion, and how its qualities are weighed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from multimodal_to.arguments import check_fields, checked
from multimodal_to.errors import ScenarioError, listed, shown
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround, Surface, heights_below
from multimodal_to.models.units import OwnSize
from multimodal_to.scenarios.contacts import ContactStretch
from multimodal_to.scenarios.failures import JetFailure
from multimodal_to.scenarios.gaits import GaitPlan
from multimodal_to.scenarios.keyframes import (
    AXES,
    HOME,
    Keyframe,
    Placed,
    asked_of,
    by_axis,
    contradiction,
)
from multimodal_to.scenarios.limits import Limits
from multimodal_to.scenarios.margins import Margins
from multimodal_to.scenarios.regions import Box, Wall
from multimodal_to.scenarios.weights import Weights
from multimodal_to.trajectory.instants import END, START
from multimodal_to.trajectory.pushes import KnownPush
from multimodal_to.values import FrozenMapping

Vector3 = tuple[float, float, float]

MOST_KNOTS = 10_000
"""More knots than this are a slip of the pen, and would fill any memory."""
COMPLEMENTARITY = 1.6e-4
"""ε_n where a scenario says none [m g L / n]: half of what the audit lets height × normal force be."""
SLIDING = 6.4e-5
"""ε_t where a scenario says none [m g L / n]: tighter, because slips add up while a foot stands."""
_BASE_SPEED, _COM_RANGE = OwnSize(2.0), OwnSize(1.5)
_FASTER = 1.5  # of a throw of the CoM: the base
_LONGEST_NAME = 100


class Start(Enum):
    """How a motion starts."""

    STANDING = "standing"
    """In a posture near home with every contact point on the ground, held by contact forces; jets idle."""
    HOVER = "hover"
    """At rest in the air, in a posture that is found: no contact force, steady thrusts carry the weight."""
    GIVEN = "given"
    """In a state that `build` or a `Planner` is given, moving or not; `initial_com` is replaced by its CoM."""


class Terminal(Enum):
    """How a motion ends."""

    HOVER = "hover"
    """At rest in the air: nothing moves, no contact force, the thrusts carry the weight and hold still."""
    STANDING = "standing"
    """At rest with every contact point on the ground; jets may still be spooling down."""
    FREE = "free"
    """Only the final CoM is asked for; the final costs pull the rest towards equilibrium."""


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A task: how a motion starts, passes and ends, in how many knots and how much time, and the weights.

    Start, end and what keyframes ask for between may be said by short names or by `keyframes`.

    Raises:
        ScenarioError: numbers that contradict each other.
    """

    name: str
    """What the scenario is called; results go to a folder of that name."""
    title: str
    """What it is about, for a person."""
    knots: int
    """N, the number of intervals [1]."""
    initial_com: Vector3 | str | None = None
    """Where the CoM starts, in the world, three numbers or "home" [m]; the keyframe of the start may say it."""
    initial_com_shift: Vector3 | None = None
    """Where the CoM starts, from home's [m]."""
    final_com: Vector3 | str | None = None
    """Where the CoM ends, in the world, three numbers or "home" [m]; the keyframe of the end may say it."""
    final_com_shift: Vector3 | None = None
    """Where the CoM ends, from home's [m]."""
    start: Start | None = None
    """How the motion starts; by default as the keyframe of the start says, else standing."""
    terminal: Terminal | None = None
    """How the motion ends; by default as the keyframe of the end says, which there has to be then."""
    keyframes: tuple[Keyframe, ...] = ()
    """What is asked of the motion at chosen knots, beside its start and its end."""
    initial_state: str | None = None
    """Trajectory file with the state that the motion starts in, in a file relative to that file; the start is given."""
    initial_knot: int | None = None
    """Which knot of that file it starts in, the last one by default [1]."""
    robot: str | None = None
    """The robot that it is for: a bundled one by name, or a robot's folder, in a file relative to that file."""
    mid_height_min: float | None = None
    """Least height of the CoM at mid-horizon, where one is asked for [m]."""
    jets: bool = True
    """Whether the robot uses its jets; without them the problem has none."""
    interval_min: float
    """Least Δt [s]."""
    interval_max: float
    """Greatest Δt [s]."""
    weights: Weights
    """The weight of each cost."""
    margins: Margins = field(default_factory=Margins)
    """How far the plan stays away from the edge of what the robot can do."""
    surface: Surface = field(default_factory=FlatGround)
    """The ground."""
    friction: float | None = None
    """Coefficient of friction [1]; where there is none, the robot's own holds."""
    friction_cone: FrictionCone = FrictionCone.PYRAMID
    """Which forces a contact point can bear without slipping."""
    complementarity_max: float | None = None
    """ε_n, greatest height × normal force of a contact point [N m]; where there is none, 1.6e-4 m g L / n."""
    sliding_max: float | None = None
    """ε_t, greatest slip over an interval × normal force [N m]; where there is none, 6.4e-5 m g L / n."""
    base_speed_max: float | None = None
    """Greatest size of each component of the base's twist [m/s, rad/s]; by default it follows from the robot."""
    com_range: Vector3 | None = None
    """The CoM's greatest distance from the world's origin, by axis [m]; by default it follows from the robot."""
    allowances: Mapping[str, float] = field(default_factory=dict)
    """Limits of the audit's properties by name, where they are wider than the audit's own [the property's own]."""
    guess_steps: int = 0
    """How many steps the feet take in the start guess, in turns [1]; with 0 they glide along with the CoM."""
    contacts: tuple[ContactStretch, ...] = ()
    """Which feet stand and which are in the air, over which stretches; what is not given is found."""
    gait: GaitPlan | None = None
    """Steps in a pattern, which give every foot; what `contacts` says beside it holds instead."""
    failures: tuple[JetFailure, ...] = ()
    """Jets that fail, and when."""
    pushes: tuple[KnownPush, ...] = ()
    """Forces from outside that the plan knows of."""
    walls: tuple[Wall, ...] = ()
    """Half-spaces that the robot stays in."""
    boxes: tuple[Box, ...] = ()
    """Boxes that the robot keeps out of, or stays in."""
    limits: tuple[Limits, ...] = ()
    """Speeds and thrusts that are limited over stretches, tighter than by the robot and by `base_speed_max`."""

    def __post_init__(self) -> None:
        check_fields(self, ScenarioError)
        object.__setattr__(self, "allowances", FrozenMapping(self.allowances))
        object.__setattr__(self, "keyframes", tuple(self.keyframes))
        for label in ("contacts", "failures", "pushes", "walls", "boxes", "limits"):
            object.__setattr__(self, label, tuple(getattr(self, label)))
        self._check_name()
        self._check_numbers()
        self._take_ends()
        self._check_positions()
        self._check_keyframes()
        self._check_reach()

    @checked
    def contact_bounds(self, robot: Robot) -> tuple[float, float]:
        """Return ε_n and ε_t [N m]; those left open are `COMPLEMENTARITY` and `SLIDING` of m g L / n.

        n is the number of contact points, so that a point that bears its share of the weight is let as near to the
        ground by every robot.
        """
        unit = robot.weight * robot.standing_height / max(len(robot.contacts), 1)
        return self.complementarity_max or COMPLEMENTARITY * unit, self.sliding_max or SLIDING * unit

    @checked
    def base_speeds(self, robot: Robot) -> tuple[float, float]:
        """Return how fast the base may be along an axis [m/s] and about one [rad/s].

        By default 2 m/s and 2 rad/s for the iRonCub, in the robot's own units for others. Where a robot has no jets it
        may be half as fast again as a throw to the highest CoM that is asked for: 1.5 √(2 g Δ), Δ above the start. The
        base is faster than the CoM, since legs on the ground are slower.
        """
        if self.base_speed_max is not None:
            return self.base_speed_max, self.base_speed_max
        linear, angular = (_BASE_SPEED.of(unit, robot.units) for unit in ("m/s", "rad/s"))
        heights = self._asked_of_com("z")
        rise = max(heights) - heights[0] if heights and not robot.jets else 0.0
        return max(linear, _FASTER * math.sqrt(2.0 * robot.units.gravity * rise)), angular

    @checked
    def com_box(self, robot: Robot) -> Vector3:
        """Return how far the CoM may be from the world's origin, by axis [m].

        By default 1.5 m for the iRonCub, in the robot's own length for others, and at least half of L beyond what is
        asked for.
        """
        if self.com_range is not None:
            return self.com_range
        least = _COM_RANGE.of("m", robot.units)
        x, y, z = (
            max([least, *(abs(one) + 0.5 * robot.units.length for one in self._asked_of_com(axis))]) for axis in AXES
        )
        return x, y, z

    def _asked_of_com(self, axis: str) -> list[float]:
        """Return which coordinates along an axis the CoM is asked to have, or to be above [m]; of a state's none."""
        ends = (self.initial_com, self.final_com, *(one.com for one in self.keyframes))
        asked = [by_axis(one) for one in ends if not isinstance(one, str)]
        asked += [one.com_min for one in self.keyframes]
        if self.mid_height_min is not None:
            asked.append({"z": self.mid_height_min})
        return [one[axis] for one in asked if axis in one]

    # ---------------------------------------------------------------- keyframes

    @property
    def start_com(self) -> Vector3:
        """Return where the CoM starts [m].

        Raises:
            ScenarioError: it is said from a robot's home, see `for_robot`, or a state will say it.
        """
        asked = [self.initial_com, *(one.com for one in self.held_at(0))]
        found = next((com for com in asked if isinstance(com, tuple)), None)
        if found is None:
            raise ScenarioError("initial_com is no position yet; expected a scenario of `for_robot`")
        return found

    @property
    def end_com(self) -> Vector3:
        """Return where the CoM ends [m]; along an axis for which nothing is asked, where it was asked to be last."""
        if isinstance(self.final_com, tuple):
            return self.final_com
        known = dict(zip(AXES, self.start_com, strict=True))
        for one in sorted(self.placed(), key=lambda some: some.knot):
            known |= {} if isinstance(one.keyframe.com, str) else by_axis(one.keyframe.com)
        return known["x"], known["y"], known["z"]

    @property
    def says_end_com(self) -> bool:
        """Return whether the whole CoM is asked for at the end, by `final_com` or by a keyframe."""
        return self.final_com is not None or any(
            one.of_home or isinstance(one.com, tuple) for one in self.held_at(self.knots)
        )

    @checked
    def for_robot(self, robot: Robot) -> Scenario:
        """Return the scenario with numbers for a CoM that is said from home's, on the ground below the origin.

        Raises:
            ScenarioError: a keyframe names a joint or a frame that the robot lacks, or contradicts another.
        """
        for one in self.placed():
            one.keyframe.check_names(robot, one.label)
        if HOME not in (self.initial_com, self.final_com) and not any(one.of_home for one in self.keyframes):
            return self
        x, y, z = robot.home_com
        home = x, y, z + float(heights_below(self.surface, np.array([[x], [y], [z]]))[0])
        return replace(
            self,
            initial_com=_placed(self.initial_com, self.initial_com_shift, home),
            initial_com_shift=None,
            final_com=_placed(self.final_com, self.final_com_shift, home),
            final_com_shift=None,
            keyframes=tuple(keyframe.from_home(home) for keyframe in self.keyframes),
        )

    def short_keyframes(self) -> tuple[Placed, ...]:
        """Return the keyframes that have a short name: what `start` and `terminal`, and the CoM's numbers, ask for."""
        asked: list[tuple[str, int, dict[str, object]]] = [
            (START, 0, {"com": self.initial_com, "com_shift": self.initial_com_shift} | _ASKED[self.start]),
            (
                "middle",
                self.knots // 2,
                {} if self.mid_height_min is None else {"com_min": {"z": self.mid_height_min}},
            ),
            (END, self.knots, {"com": self.final_com, "com_shift": self.final_com_shift} | _ASKED[self.terminal]),
        ]
        return tuple(
            Placed(label=label, knot=knot, keyframe=Keyframe(knot=knot, **some))  # type: ignore[arg-type]
            for label, knot, some in asked
            if any(value is not None for value in some.values())
        )

    def own_keyframes(self) -> tuple[Placed, ...]:
        """Return those of `keyframes` at their knots."""
        return tuple(
            Placed(label=f"keyframe {index}", knot=keyframe.at(self.knots), keyframe=keyframe)
            for index, keyframe in enumerate(self.keyframes, 1)
        )

    def keyframes_between(self) -> tuple[Placed, ...]:
        """Return those of `keyframes` that are neither at the first knot nor at the last."""
        return tuple(one for one in self.own_keyframes() if 0 < one.knot < self.knots)

    def placed(self) -> tuple[Placed, ...]:
        """Return every keyframe at its knot: those with a short name, then those of `keyframes`."""
        return (*self.short_keyframes(), *self.own_keyframes())

    @checked
    def held_at(self, knot: int) -> list[Keyframe]:
        """Return those of `keyframes` that hold at a knot, and are no costs."""
        return [one for one in self.keyframes if one.weight is None and one.at(self.knots) == knot]

    def _take_ends(self) -> None:
        """Take how it starts and ends from the keyframes of the first and last knots, which have to say it then."""
        first, last = self.held_at(0), self.held_at(self.knots)
        self._take_state()
        if self.start is None:
            object.__setattr__(self, "start", Start.HOVER if any(one.hover for one in first) else Start.STANDING)
        if self.terminal is None and not last:
            raise ScenarioError("the scenario lacks 'terminal', or a keyframe for its end")
        if self.terminal in (None, Terminal.FREE):
            hovers, stands = (any(getattr(one, name) for one in last) for name in ("hover", "standing"))
            ends = Terminal.HOVER if hovers else Terminal.STANDING if stands else Terminal.FREE
            object.__setattr__(self, "terminal", ends)
        self._take_shift("initial_com")
        self._take_shift("final_com")
        if self.initial_com is None and self.start is Start.GIVEN:
            object.__setattr__(self, "initial_com", HOME)  # until the state says it
        if self.initial_com is None and not any(one.of_home or isinstance(one.com, tuple) for one in first):
            raise ScenarioError("the scenario lacks 'initial_com', or a keyframe for its start with a whole 'com'")
        if self.final_com is None and not last:
            raise ScenarioError("the scenario lacks 'final_com', or a keyframe for its end")

    def _take_state(self) -> None:
        """Let a motion that starts in the state of a file start as given."""
        if self.initial_state is not None:
            if self.start not in (None, Start.GIVEN):
                raise ScenarioError(f"initial_state says how it starts, and start is '{word(self.start)}'")
            object.__setattr__(self, "start", Start.GIVEN)
        elif self.initial_knot is not None:
            raise ScenarioError("initial_knot is of no file; expected initial_state beside it")

    def _take_shift(self, name: str) -> None:
        """Take the CoM of an end from home, where only a shift is given."""
        com, shift = getattr(self, name), getattr(self, f"{name}_shift")
        if shift is not None and com is None:
            object.__setattr__(self, name, HOME)
        elif shift is not None and com != HOME:
            raise ScenarioError(f"{name}_shift is from home's CoM, and {name} has numbers; expected one of them")

    def _check_keyframes(self) -> None:
        """Refuse keyframes outside of the horizon, and those that contradict each other."""
        for one in self.placed():
            if one.knot > self.knots:
                raise ScenarioError(f"{one.label}: knot is {one.knot}; expected 0 to {self.knots}, the number of knots")
            if one.knot == 0 and one.label != START and one.keyframe.weight is None:
                self._check_first(one)
        for knot in sorted({one.knot for one in self.placed()}):
            here = [one for one in self.placed() if one.knot == knot and one.keyframe.weight is None]
            in_air, on_feet = (
                next((one.label for one in here if getattr(one.keyframe, name)), "") for name in ("hover", "standing")
            )
            if in_air and on_feet:
                raise ScenarioError(
                    f"{in_air} asks for a hover at knot {knot} and {on_feet} for standing; expected one of them"
                )
        if found := contradiction(self.placed()):
            raise ScenarioError(found)

    def _check_first(self, one: Placed) -> None:
        """Refuse what the start says itself: a standing start is a posture that is found, a given one is a state."""
        if self.start is Start.HOVER:
            return
        taken = (*_OF_START, "yaw", "joints") if self.start is Start.STANDING else _OF_START
        if more := [name for name in asked_of(one.keyframe) if name not in taken]:
            raise ScenarioError(
                f"{one.label} asks for {listed(more)} at the first knot, and a start that is '{word(self.start)}' "
                "gives the rest of the posture there; expected it at a later knot, or a start in a hover"
            )

    def _check_name(self) -> None:
        """Refuse a name that is no plain one, since results go to a folder of that name, and titles no screen takes."""
        plain = self.name.isprintable() and not set(self.name) & set("/\\") and self.name.strip(". ")
        if not plain or len(self.name) > _LONGEST_NAME:
            raise ScenarioError(
                f"name is {shown(self.name)}; expected one that a folder can have, of at most {_LONGEST_NAME} "
                "characters and none of / and \\"
            )

        if any(character < " " and character != "\n" for character in self.title):
            raise ScenarioError(f"title is {shown(self.title)}; expected a text without control characters")

    def _check_numbers(self) -> None:
        if not 3 <= self.knots <= MOST_KNOTS:
            raise ScenarioError(f"knots is {shown(self.knots)}; expected 3 to {MOST_KNOTS}")
        if not (0 < self.interval_min <= self.interval_max < math.inf):
            raise ScenarioError(
                f"interval_min is {self.interval_min} s and interval_max {self.interval_max} s; "
                "expected 0 < interval_min <= interval_max"
            )
        for label in ("complementarity_max", "sliding_max", "base_speed_max", "friction"):
            value = getattr(self, label)
            if value is not None and not 0 < value < math.inf:
                raise ScenarioError(f"{label} is {value}; expected a positive number")
        if self.mid_height_min is not None and not math.isfinite(self.mid_height_min):
            raise ScenarioError(f"mid_height_min is {self.mid_height_min}; expected a finite number [m]")
        if not 0 <= self.guess_steps <= self.knots:
            raise ScenarioError(f"guess_steps is {shown(self.guess_steps)}; expected 0 to the number of knots")

    def _check_positions(self) -> None:
        for label in ("initial_com", "final_com"):
            if isinstance(text := getattr(self, label), str) and text != HOME:
                raise ScenarioError(f"{label} is {shown(text)}; expected three numbers or '{HOME}'")
        for label in ("initial_com", "final_com", "initial_com_shift", "final_com_shift", "com_range"):
            value = getattr(self, label)
            if value is None or isinstance(value, str):
                continue
            if len(value) != 3 or not all(math.isfinite(number) for number in value):
                raise ScenarioError(f"{label} is {value}; expected three finite numbers [m]")
            object.__setattr__(self, label, tuple(map(float, value)))
        for label in ("initial_com", "final_com"):
            if not isinstance(position := getattr(self, label), tuple):
                continue
            for axis, number, bound in zip(AXES, position, self.com_range or (math.inf,) * 3, strict=True):
                if abs(number) > bound:
                    raise ScenarioError(f"{label} has {axis} = {number} m, beyond com_range, {bound} m")

    def _check_reach(self) -> None:
        """Refuse a distance that the CoM cannot travel at the greatest base speed in the longest time."""
        longest = self.knots * self.interval_max
        if self.base_speed_max is None:
            return
        if not (isinstance(self.initial_com, tuple) and isinstance(self.final_com, tuple)):
            return
        for axis, start, end in zip(AXES, self.initial_com, self.final_com, strict=True):
            if abs(end - start) > self.base_speed_max * longest:
                raise ScenarioError(
                    f"the CoM has to go {abs(end - start):.3g} m along {axis} in at most {longest:.3g} s, faster than "
                    f"base_speed_max, {self.base_speed_max} m/s; allow more knots, a longer interval_max or more speed"
                )


_ASKED: dict[Start | Terminal | None, dict[str, object]] = {
    Start.STANDING: {"standing": True},
    Start.HOVER: {"hover": True},
    Start.GIVEN: {},
    Terminal.HOVER: {"hover": True},
    Terminal.STANDING: {"standing": True},
    Terminal.FREE: {},
}
"""What a start or an end is as a keyframe."""
_OF_START = ("com", "com_shift", "standing", "rest")
"""What a keyframe may ask for at a first knot that is not found; a standing one may be turned and bent as well."""


def _placed(com: Vector3 | str | None, shift: Vector3 | None, home: Vector3) -> Vector3 | str | None:
    """Return the CoM of an end with numbers [m].

    Args:
        com: as the scenario has it.
        shift: from home's.
        home: where that is.
    """
    if com != HOME:
        return com
    x, y, z = (a + b for a, b in zip(home, shift or (0.0, 0.0, 0.0), strict=True))
    return x, y, z


def word(start: Start | Terminal | None) -> str:
    """Return how a file says a start or an end."""
    return "" if start is None else start.value
