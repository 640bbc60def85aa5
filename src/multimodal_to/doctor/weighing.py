"""Whether weights and allowances name what exists, and whether the sizes of costs and variables can be compared."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from multimodal_to.auditing import check_allowances
from multimodal_to.doctor.diagnosis import Symptom, error, note, warning
from multimodal_to.doctor.task import Task
from multimodal_to.errors import FormulationError, InputError, ModelError
from multimodal_to.models.units import size_of
from multimodal_to.solving.ipopt import Ipopt
from multimodal_to.trajectory import QUANTITIES

_FAINT = Ipopt().tolerance ** 2
"""Share of the greatest cost below which one is lost: costs are squares, and the solver stops at its tolerance."""
_OBJECTIVE = (1e-2, 1e5)
"""Sizes of the scaled objective with which the solver is known to get on [1]; the bundled ones have 1e3."""
_OFF = 30.0
"""How many times its scale a variable may be before it is worth saying [1]."""
_JETS = ("thrust", "thrust_rate", "throttle")


def groups(task: Task) -> Iterator[Symptom]:
    """Look up the joint groups that weights name."""
    members = Counter[str]()
    for group in task.scenario.weights.joint_velocities:
        try:
            task.robot.group_indices(group)
        except ModelError as cause:
            yield error(
                "weights",
                f"weights.joint_velocities: {cause}",
                "name a joint group of the robot's robot.toml; in a file with 'based_on', "
                'replace = ["weights.joint_velocities"] leaves out those of the bundled scenario',
            )
        else:
            members.update(task.robot.joint_groups[group])
    if twice := [name for name, count in members.items() if count > 1]:
        yield warning(
            "weights",
            f"weights.joint_velocities weighs {', '.join(twice)} by more than one group, and the last one counts alone",
            "name groups that do not overlap",
        )


def allowances(task: Task) -> Iterator[Symptom]:
    """Look up the properties of the audit that the scenario allows more of."""
    try:
        check_allowances(task.robot, task.scenario)
    except InputError as cause:
        yield error("allowances", str(cause), "name a property that the audit of this task judges")


def costs(task: Task) -> Iterator[Symptom]:
    """Compare costs, weight × scale² of their residuals, with each other and with what the solver gets on with."""
    try:
        sizes = _sizes(task)
    except FormulationError as cause:
        yield error("weights", str(cause), "change the term, or leave it out")
        return
    except ModelError:  # a group that does not exist, which `groups` names
        return
    if not task.robot.jets:
        idle = [name for name in _JETS if sizes.pop(name, 0.0)]
        if idle and task.scenario.jets:
            yield note("weights", f"{', '.join(idle)} weigh nothing: {task.robot.name} has no jets")
    if not sizes:
        yield warning(
            "weights",
            "no cost has a weight, so that any motion that is possible is as good as another",
            "give weights to what matters",
        )
        return
    greatest = max(sizes, key=lambda name: sizes[name])
    for name, size in sizes.items():
        if size < _FAINT * sizes[greatest]:
            yield warning(
                "weights",
                f"at the size that the solver takes for one, {name} costs {size:.1e} and {greatest} "
                f"{sizes[greatest]:.1e}: the objective cannot see the smaller",
                f"raise the weight of {name} or lower that of {greatest}",
            )
    scaled = Ipopt().objective_scale * sizes[greatest]
    if not _OBJECTIVE[0] <= scaled <= _OBJECTIVE[1]:
        yield warning(
            "scale of the objective",
            f"the greatest cost, {greatest}, is {scaled:.1e} in the solver's units, beyond {_OBJECTIVE[0]:g} to "
            f"{_OBJECTIVE[1]:g}",
            f"multiply all weights by {1e3 / scaled:.0e}, or solve with Ipopt(objective_scale=...) so much larger",
        )


def _sizes(task: Task) -> dict[str, float]:
    """Return weight × scale² of each cost that has a weight, by name."""
    parameters = task.parameters
    sizes = {}
    for term in task.formulation.costs:
        if term.exists(parameters):
            of_rows = np.array([size_of(term.scale, unit, task.robot.units) for unit in term.units(parameters)])
            heaviest = float(np.max(term.weights(parameters) * of_rows**2, initial=0.0))
            if heaviest:
                sizes[term.name] = heaviest
    return sizes


def scales(task: Task) -> Iterator[Symptom]:
    """Compare what the robot's variables will be with the sizes that the solver takes for one."""
    robot, scenario = task.robot, task.scenario
    known = {variable.name: max(variable.scales(robot), default=1.0) for variable in task.formulation.variables}
    expected = {"com_position": float(np.abs([scenario.start_com, scenario.end_com]).max())}
    if robot.contacts:
        expected = {"contact_forces": robot.weight / len(robot.contacts), **expected}
    if robot.jets and task.hovers:
        expected["thrust"] = robot.weight / len(robot.jets)
    for name, size in expected.items():
        unit = QUANTITIES[name].unit
        yield from _off(
            name, size, known[name], unit, f"Formulation.executable().with_scales({{'{name}': {size:.1g}}})"
        )
    interval = scenario.interval_max
    change = f"replace(Formulation.executable(), interval_scale={interval:.1g})"
    yield from _off("interval", interval, size_of(task.formulation.interval_scale, "s", robot.units), "s", change)


def _off(name: str, size: float, scale: float, unit: str, change: str) -> Iterator[Symptom]:
    """Compare a variable's size with its scale, both in its unit, and say what to change."""
    if size and not 1 / _OFF <= size / scale <= _OFF:
        yield warning(
            "scales",
            f"{name} will be about {size:.2g} {unit}, and the solver takes {scale:g} {unit} for one",
            f"build with formulation={change}",
        )
