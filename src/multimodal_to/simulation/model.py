"""A robot and its ground as a MuJoCo model, from the same URDF reader: same masses, inertias, frames and friction.

Every link is a body. Joints are those that the plan moves, and the mimic joints that follow them, each held to its
leader by an equality constraint; the others are held where the robot holds them.
Feet are points: a small sphere at each contact point, on a ground that lies one radius deeper, so that a point touches
where d(p) = 0. Nothing else of the robot touches anything.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from multimodal_to.adam.spatial import Array, Inertia
from multimodal_to.adam.tree import FixedFrame, Joint, Link, Tree
from multimodal_to.adam.urdf import read_urdf
from multimodal_to.arguments import checked, vector
from multimodal_to.errors import InputError, ModelError, OutputError, listed, said
from multimodal_to.models.robot import Robot
from multimodal_to.models.terrain import FlatGround, Plane, Surface, frame_function, heights_below

TIME_STEP = 1e-3  # [s]
POINT_RADIUS = 2e-3  # of the sphere at a contact point [m]
CONTACT_TIME = 5e-3
"""Time constant of a contact, critically damped [s]: the softest part of the model."""
COUPLING_TIME = 2.0 * TIME_STEP
"""Time constant of what holds a follower to its leader, critically damped [s]: the shortest that a step allows."""
COUPLING_STRENGTH = 0.9999
"""Share of the error that the coupling takes on itself [1]; the rest gives way."""
SMALLEST_INERTIA = 1e-14
"""MuJoCo takes no body with a smaller principal inertia [kg m²]."""
_ROUNDING = 1e-9
CELL = 0.02  # of the grid on which ground that is no plane is sampled [m]
DEPTH = 1.0  # of the ground below its lowest point [m]


def mujoco_module() -> ModuleType:
    """Return the package `mujoco`.

    Raises:
        OutputError: it is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise OutputError("a simulation needs MuJoCo: pip install 'multimodal-to[sim]'") from error
    return mujoco  # type: ignore[no-any-return]


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulationModel:
    """A compiled model with where its numbers stand.

    MuJoCo's qpos is (p, quaternion w x y z, joints), its qvel (ṗ in world axes, ω in the base's axes, joint
    velocities), with the joints in an order of its own. Its ctrl is in the robot's order: the torque of each joint's
    motor [N m or N] without what its servo adds, then the thrusts [N].
    """

    robot: Robot
    model: Any  # mujoco.MjModel
    joint_positions: NDArray[np.int64]  # of s in qpos, (n,)
    joint_velocities: NDArray[np.int64]  # of ṡ in qvel, (n,)
    coupling: Array  # G: the joints in qvel move with G ṡ, followers too; forces on them are Gᵀ f for s, (nv, n)
    offsets: Array  # the joints in qpos are at these plus G s [rad or m], (nv − 6,)
    points: NDArray[np.int64]  # geom of each contact point, (contacts,)
    jets: NDArray[np.int64]  # site of each jet, (jets,)
    notes: tuple[str, ...]  # what differs from the URDF, a sentence each

    @checked
    def set_state(
        self,
        data: Any,
        position: Array,
        quaternion_xyzw: Array,
        joints: Array,
        velocity: Array,
        joint_velocities: Array,
    ) -> None:
        """Put `data` into a state.

        Args:
            data: MuJoCo's `MjData` of this model.
            position: p of the base in the world [m], (3,).
            quaternion_xyzw: of the base in the world, of any length, (4,).
            joints: s in the robot's order [rad or m], (n,).
            velocity: (ṗ, ω) of the base in world axes [m/s, rad/s], (6,).
            joint_velocities: ṡ in the robot's order [rad/s or m/s], (n,).
        """
        turn = np.zeros(9)
        data.qpos[:3], data.qpos[3:7] = position, quaternion_xyzw[[3, 0, 1, 2]] / np.linalg.norm(quaternion_xyzw)
        if joints.shape != (self.coupling.shape[1],):
            raise InputError(f"'joints' has the shape {joints.shape}; expected ({self.coupling.shape[1]},)")
        data.qpos[7:] = self.offsets + self.coupling[6:] @ joints
        mujoco_module().mju_quat2Mat(turn, data.qpos[3:7])
        data.qvel[:3], data.qvel[3:6] = velocity[:3], turn.reshape(3, 3).T @ velocity[3:]
        data.qvel[6:] = (self.coupling @ joint_velocities)[6:]

    @checked
    def set_servos(self, stiffness: Array, damping: Array) -> None:
        """Let each joint's motor add −K s − D ṡ to its control; MuJoCo integrates the damping implicitly.

        Args:
            stiffness: K [N m/rad or N/m], (n,).
            damping: D [N m s/rad or N s/m], (n,).
        """
        count = len(self.robot.joint_names)
        self.model.actuator_biasprm[:count, 1], self.model.actuator_biasprm[:count, 2] = -stiffness, -damping


@checked
def build_model(
    robot: Robot,
    surface: Surface | None = None,
    friction: float | None = None,
    *,
    middle: Array | None = None,
    reach: float = 3.0,
    torque_limits: bool = True,
) -> SimulationModel:
    """Return a robot on its ground.

    Args:
        robot: which joints move, where it touches, which jets it has.
        surface: the ground; without one nothing is below the robot.
        friction: Coulomb's μ, a round cone; the robot's own by default.
        middle: of the ground that is built where it is no plane [m], (2,); the world's origin by default.
        reach: how far that goes to each side [m].
        torque_limits: clip what the motor of a joint gives at the joint's effort limit.

    Raises:
        InputError: the friction, the reach or the middle is no number that the ground can have.
        OutputError: MuJoCo is not installed.
        ModelError: MuJoCo refuses the robot, for example because of an inertia that no body can have.
    """
    if friction is not None and not 0.0 <= friction < np.inf:
        raise InputError(f"the ground's friction is {friction}; expected a finite number of at least zero")
    if not 0.0 < reach < np.inf:
        raise InputError(f"the ground's reach is {reach} m; expected a positive finite number")
    if middle is not None:
        vector("the middle of the ground", middle, 2)
    mujoco = mujoco_module()
    spec = mujoco.MjSpec()
    spec.option.gravity = robot.gravity
    spec.option.timestep = TIME_STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 100.0  # friction as stiff as a foot that must not creep needs it
    spec.compiler.boundmass = spec.compiler.boundinertia = 0.0  # keep what the URDF says
    spec.compiler.balanceinertia = False
    spec.compiler.discardvisual = spec.compiler.fusestatic = False
    notes = _add_bodies(mujoco, spec, robot)
    _add_couplings(mujoco, spec, robot)
    mu = robot.friction if friction is None else friction
    for name in robot.contact_names:
        spec.body(body_name(robot, name)).add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[POINT_RADIUS, 0.0, 0.0],
            mass=0.0,
            condim=3,
            friction=[mu, 0.0, 0.0],
            solref=[CONTACT_TIME, 1.0],
            contype=1,
            conaffinity=0,
        )
    if surface is not None:
        ground = _free("ground", robot.contact_names)
        _add_ground(mujoco, spec, surface, mu, np.zeros(2) if middle is None else middle, reach, ground)
    _add_actuators(mujoco, spec, robot, robot.joint_limits.effort if torque_limits else None)
    try:
        model = spec.compile()
    except ValueError as error:
        raise ModelError(f"MuJoCo refuses '{robot.urdf}': {said(error)}") from error
    return SimulationModel(
        robot=robot,
        model=model,
        joint_positions=_integers(model.joint(name).qposadr[0] for name in robot.joint_names),
        joint_velocities=_integers(model.joint(name).dofadr[0] for name in robot.joint_names),
        coupling=_coupling(model, robot),
        offsets=_offsets(model, robot),
        points=_integers(model.geom(name).id for name in robot.contact_names),
        jets=_integers(model.site(name).id for name in robot.jet_names),
        notes=notes,
    )


def _integers(values: Iterable[int]) -> NDArray[np.int64]:
    return np.array(list(values), dtype=np.int64)


def _coupling(model: Any, robot: Robot) -> Array:
    """Return G, (nv, n): how fast each of MuJoCo's velocities is for a unit of each joint of s."""
    tree, coupling = robot.kindyn.tree, np.zeros((model.nv, len(robot.joint_names)))
    for column, name in enumerate(robot.joint_names):
        coupling[model.joint(name).dofadr[0], column] = 1.0
    for name, how in tree.followers.items():
        coupling[model.joint(name).dofadr[0], robot.joint_names.index(how.joint)] = how.multiplier
    return coupling


def _offsets(model: Any, robot: Robot) -> Array:
    """Return where the joints in qpos are while s is zero, (nv − 6,): followers may be off it."""
    offsets = np.zeros(model.nv - 6)
    for name, how in robot.kindyn.tree.followers.items():
        offsets[model.joint(name).dofadr[0] - 6] = how.offset
    return offsets


def _add_couplings(mujoco: ModuleType, spec: Any, robot: Robot) -> None:
    """Hold every follower to its leader: q = offset + multiplier · q_leader."""
    for name, how in robot.kindyn.tree.followers.items():
        held = spec.add_equality(
            name=name,
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=name,
            name2=how.joint,
            solref=[COUPLING_TIME, 1.0],
            solimp=[COUPLING_STRENGTH, COUPLING_STRENGTH, 1e-3, 0.5, 2.0],
        )
        held.data = [how.offset, how.multiplier, *np.zeros(len(held.data) - 2)]  # more numbers in newer versions


def _add_bodies(mujoco: ModuleType, spec: Any, robot: Robot) -> tuple[str, ...]:
    """Add every link, parents first, and the joints that move; return what was merged, a sentence each."""
    links, joints = read_urdf(robot.urdf)
    tree = robot.kindyn.tree
    by_name, notes = _merged(tree, links)
    below: dict[str, list[Joint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    of_link: dict[str, list[tuple[str, FixedFrame]]] = {}
    for frame, fixed in robot.added_frames.items():
        of_link.setdefault(fixed.link, []).append((frame, fixed))
    base = spec.worldbody.add_body(name=body_name(robot, tree.base))
    base.add_freejoint()
    pending = [(tree.base, base)]
    while pending:
        name, body = pending.pop()
        _set_inertia(body, by_name[name])
        for frame, added in of_link.get(name, ()):
            body.add_body(
                name=body_name(robot, frame), pos=added.translation, quat=_quaternion(mujoco, added.rotation)
            ).explicitinertial = True
        for joint in reversed(below.get(name, [])):
            child = body.add_body(
                name=body_name(robot, joint.child), pos=joint.translation, quat=_quaternion(mujoco, joint.rotation)
            )
            if joint.name in tree.joint_names or joint.name in tree.followers:
                kind = mujoco.mjtJoint.mjJNT_SLIDE if joint.kind == "prismatic" else mujoco.mjtJoint.mjJNT_HINGE
                child.add_joint(name=joint.name, type=kind, axis=joint.axis)
            elif joint.kind != "fixed":
                _hold(mujoco, child, joint, tree.locked[joint.name])
            pending.append((joint.child, child))
    return notes


def _merged(tree: Tree, links: Sequence[Link]) -> tuple[dict[str, Link], tuple[str, ...]]:
    """Return the links by name, merged where MuJoCo would refuse one, and a note on each that it would.

    All links that move together are then one, as in `tree`, at the one whose joint moves them.
    """
    by_name = {link.name: link for link in links}
    groups: dict[str, list[Link]] = {}
    for link in links:
        groups.setdefault(tree.merged.get(link.name, link.name), []).append(link)
    notes = []
    for carrier, group in groups.items():
        massive = [link for link in group if link.mass > 0 or link.inertia.any()]
        refused = [link for link in massive if not _is_body(link, moves=link.name == carrier)]
        if not refused or len(massive) < 2:
            continue
        by_name |= {link.name: Link(name=link.name) for link in group} | {carrier: _sum(tree, carrier, massive)}
        for link in refused:
            others = listed(other.name for other in massive if other is not link)
            notes.append(
                f"MuJoCo takes no body like the link '{link.name}' ({link.mass:g} kg) by itself; it is merged with "
                f"{others}, which move with it"
            )
    return by_name, tuple(notes)


def _is_body(link: Link, *, moves: bool) -> bool:
    """Return whether MuJoCo takes a link by itself; it also takes point masses that are fixed to what moves."""
    if not link.inertia.any():
        return not moves
    smallest, middle, largest = np.linalg.eigvalsh(link.inertia)
    return bool(smallest > SMALLEST_INERTIA and smallest + middle >= largest * (1.0 + _ROUNDING))


def _sum(tree: Tree, carrier: str, links: Sequence[Link]) -> Link:
    """Return links that move together as one in the frame of `carrier`.

    Args:
        tree: in which they do.
        carrier: the link whose frame the sum is in.
        links: of one body of the tree.
    """
    base = tree.frame(carrier)
    total = Inertia.zero()
    for link in links:
        frame = tree.frame(link.name)
        own = Inertia(link.mass, cs.DM.zeros(3, 1), cs.DM(link.inertia)).shifted(cs.DM(link.com))
        in_body = own.rotated(frame.rotation).shifted(frame.translation)
        total += in_body.shifted(-base.translation).rotated(base.rotation.T)
    mass, com = float(total.mass), np.array(total.first_moment).ravel() / float(total.mass)
    about_com = np.array(total.about_origin) - mass * (com @ com * np.eye(3) - np.outer(com, com))
    return Link(name=carrier, mass=mass, com=com, inertia=about_com)


def _set_inertia(body: Any, link: Link) -> None:
    body.explicitinertial = True
    body.mass = link.mass
    body.ipos = link.com
    if link.inertia.any():
        body.fullinertia = link.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


def _quaternion(mujoco: ModuleType, rotation: Array) -> Array:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.asarray(rotation, dtype=float).ravel())
    return quaternion


def _hold(mujoco: ModuleType, body: Any, joint: Joint, value: float) -> None:
    """Put a body where its joint is at a value [rad or m].

    Args:
        mujoco: the package.
        body: the joint's child.
        joint: that is held.
        value: where [rad or m].
    """
    if joint.kind == "prismatic":
        body.pos = joint.translation + joint.rotation @ joint.axis * value
        return
    turn, turned = np.zeros(4), np.zeros(4)
    mujoco.mju_axisAngle2Quat(turn, joint.axis, value)
    mujoco.mju_mulQuat(turned, _quaternion(mujoco, joint.rotation), turn)
    body.quat = turned


@checked
def body_name(robot: Robot, link: str) -> str:
    """Return what the body of a link is called: as the link, or otherwise where MuJoCo's own world is called so."""
    return _free(link, robot.kindyn.frame_names) if link == "world" else link


def _free(name: str, taken: Iterable[str]) -> str:
    """Return a name that is not taken: the name itself, with as many primes behind it as that needs."""
    names = set(taken)
    while name in names:
        name += "'"
    return name


def _add_ground(
    mujoco: ModuleType, spec: Any, surface: Surface, mu: float, middle: Array, reach: float, name: str
) -> None:
    """Add the ground, one radius of the contact points deeper along its normal.

    Args:
        mujoco: the package.
        spec: the model that is being made.
        surface: the ground.
        mu: Coulomb's friction coefficient [1].
        middle: of a ground that is no plane, in the world [m], (2,).
        reach: how far that goes to each side [m].
        name: of the ground's geom.
    """
    contact = {"condim": 3, "friction": [mu, 0.0, 0.0], "solref": [CONTACT_TIME, 1.0], "contype": 0, "conaffinity": 1}
    if isinstance(surface, FlatGround | Plane):
        at = np.array([0.0, 0.0, surface.height])
        _, normal, tangents = (np.array(part) for part in frame_function(surface)(at))
        rotation = np.column_stack([tangents, normal])
        spec.worldbody.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0.0, 0.0, 1.0],
            quat=_quaternion(mujoco, rotation),
            pos=at - POINT_RADIUS * normal.ravel(),
            **contact,
        )
        return
    count = 2 * int(np.ceil(reach / CELL)) + 1
    steps = np.linspace(-reach, reach, count)
    y, x = np.meshgrid(middle[1] + steps, middle[0] + steps, indexing="ij")  # rows go along y
    points = np.vstack([x.ravel(), y.ravel(), np.zeros(x.size)])
    heights = heights_below(surface, points)
    points[2] = heights
    normals = np.array(frame_function(surface).map(x.size)(points)[1])
    heights = heights - POINT_RADIUS / normals[2]
    low, span = float(heights.min()), float(max(np.ptp(heights), 1e-6))
    spec.add_hfield(
        name=name,
        nrow=count,
        ncol=count,
        size=[reach, reach, span, DEPTH],
        userdata=((heights - low) / span).tolist(),
    )
    spec.worldbody.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=name, pos=[*middle, low], **contact
    )


def _add_actuators(mujoco: ModuleType, spec: Any, robot: Robot, limits: Array | None) -> None:
    """Add a motor at each joint, and at each jet a force along −z of a site that is the jet's frame.

    Args:
        mujoco: the package.
        spec: the model that is being made.
        robot: with joints and jets.
        limits: largest torque of each motor, infinite where it has no limit [N m or N], (n,); None limits none.
    """
    for index, name in enumerate(robot.joint_names):
        limit = np.inf if limits is None else float(limits[index])
        limited = bool(np.isfinite(limit))
        spec.add_actuator(
            name=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=name,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,  # `set_servos` says how
            forcelimited=limited,
            forcerange=[-limit, limit] if limited else [0.0, 0.0],
        )
    for jet in robot.jets:
        spec.body(body_name(robot, jet.frame)).add_site(name=jet.name)
        spec.add_actuator(
            name=_free(jet.name, robot.joint_names),
            trntype=mujoco.mjtTrn.mjTRN_SITE,
            target=jet.name,
            gear=[0.0, 0.0, -1.0, 0.0, 0.0, -jet.drag],
        )
