"""The rigid-body library next to adam (instructions) and Pinocchio (time), on the iRonCub.

    python benchmarks/rigid_body.py [--skip-adam] [--repeat N]

Instructions are those of the expanded SX functions, same inputs on both sides: H_b (4, 4), s, and twists. Times are of
the generated C at -O2, called in a loop within C, and of Pinocchio's C++ called from Python less what the same call
costs on an empty model. Ratios are taken within one run; other load on the machine moves the times, hardly the ratios.
Needs gcc, and `pin` and `adam-robotics[casadi]` from the development dependencies.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import tempfile
import timeit
import tomllib
import warnings
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import casadi as cs
import numpy as np
import pinocchio as pin

from multimodal_to.adam import KinDynComputations

ROBOT = Path(__file__).parents[1] / "robots" / "ironcub"
FRAME = "l_sole"
BUDGET = {
    "mass matrix": 7000,
    "CMM": 6000,
    "CoM": 1100,
    "bias": 5500,
    "RNEA": 6500,
    "FK of l_sole": 220,
    "Jacobian of l_sole": 500,
    "angular momentum": 3800,
    "Hessian of λᵀhω": 75000,
}


def angular_momentum(kindyn: Any, direct: bool) -> tuple[cs.Function, cs.Function]:
    """Return hω, and the upper triangle of the Hessian of λᵀhω in joints and velocities, as functions."""
    n = kindyn.NDoF
    H, s, v, s_dot = cs.SX.sym("H", 4, 4), cs.SX.sym("s", n), cs.SX.sym("v", 6), cs.SX.sym("s_dot", n)
    if direct:
        h = kindyn.centroidal_momentum(H, s, v, s_dot)[3:]
    else:
        h = (kindyn.centroidal_momentum_matrix_fun()(H, s) @ cs.vertcat(v, s_dot))[3:]
    multiplier = cs.SX.sym("lambda", 3)
    hessian = cs.hessian(cs.dot(multiplier, h), cs.vertcat(s, v[3:], s_dot))[0]
    return (
        cs.Function("h", [H, s, v, s_dot], [h]),
        cs.Function("hessian", [H, s, v, s_dot, multiplier], [cs.triu(hessian)]),
    )


def instructions(kindyn: Any, ours: bool) -> dict[str, int]:
    """Return the number of instructions of each quantity."""
    functions = {
        "mass matrix": kindyn.mass_matrix_fun(),
        "CMM": kindyn.centroidal_momentum_matrix_fun(),
        "CoM": kindyn.CoM_position_fun(),
        "CoM Jacobian": kindyn.CoM_jacobian_fun(),
        "bias": kindyn.bias_force_fun(),
        "gravity": kindyn.gravity_term_fun(),
        "ABA": kindyn.aba_fun(),
        f"FK of {FRAME}": kindyn.forward_kinematics_fun(FRAME),
        f"Jacobian of {FRAME}": kindyn.jacobian_fun(FRAME),
        f"relative Jacobian of {FRAME}": kindyn.relative_jacobian_fun(FRAME),
        f"J̇ of {FRAME}": kindyn.jacobian_dot_fun(FRAME),
    }
    if ours:
        functions |= {
            f"J̇ν of {FRAME}": kindyn.jacobian_dot_nu_fun(FRAME),
            "RNEA": kindyn.rnea_fun(),
            "Coriolis matrix": kindyn.coriolis_matrix_fun(),
            "CoM velocity": kindyn.CoM_velocity_fun(),
            "CMM rate bias": kindyn.centroidal_momentum_bias_fun(),
            "kinetic energy": kindyn.kinetic_energy_fun(),
            "potential energy": kindyn.potential_energy_fun(),
        }
    functions["angular momentum"], functions["Hessian of λᵀhω"] = angular_momentum(kindyn, direct=ours)
    return {name: function.n_instructions() for name, function in functions.items()}


def arithmetic(function: cs.Function) -> dict[str, int]:
    """Return what the instructions of a function are: data in and out, constants, sines, the rest."""
    kinds = {cs.OP_INPUT: "in", cs.OP_OUTPUT: "out", cs.OP_CONST: "constants"}
    kinds |= dict.fromkeys((cs.OP_SIN, cs.OP_COS), "sin, cos")
    found: dict[str, int] = {}
    for index in range(function.n_instructions()):
        kind = kinds.get(function.instruction_id(index), "arithmetic")
        found[kind] = found.get(kind, 0) + 1
    return found


DRIVER = """
long long int repeat(const casadi_real** arg, casadi_real** res, casadi_real* w, long long int n) {
  long long int i, bad = 0;
  for (i = 0; i < n; ++i) bad += NAME(arg, res, 0, w, 0);
  return bad;
}
"""


def compiled_time(function: cs.Function, arguments: list[np.ndarray], folder: Path, calls: int) -> Callable[[], float]:
    """Return a function that runs the compiled C once more and says how long one call took [s]."""
    generator = cs.CodeGenerator("code.c", {"with_header": False})
    generator.add(function)
    generator.generate(f"{folder}/")
    name = function.name()
    source, library = folder / f"{name}.c", folder / f"{name}.so"
    source.write_text((folder / "code.c").read_text(encoding="utf-8") + DRIVER.replace("NAME", name), encoding="utf-8")
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    repeat = ctypes.CDLL(str(library)).repeat
    pointer = ctypes.POINTER(ctypes.c_double)
    inputs = [np.asfortranarray(argument, dtype=float) for argument in arguments]
    outputs = [np.zeros(function.nnz_out(index)) for index in range(function.n_out())]
    work = np.zeros(function.sz_w() + 1)
    arg = (pointer * len(inputs))(*(value.ctypes.data_as(pointer) for value in inputs))
    res = (pointer * len(outputs))(*(value.ctypes.data_as(pointer) for value in outputs))

    def run(_alive: tuple[list[np.ndarray], ...] = (inputs, outputs)) -> float:
        count = ctypes.c_longlong(calls)
        return timeit.timeit(lambda: repeat(arg, res, work.ctypes.data_as(pointer), count), number=1) / calls

    run()
    expected = function(*arguments)
    assert np.allclose(outputs[0], np.array(expected.nonzeros()), rtol=1e-9, atol=1e-9)
    return run


def pinocchio_times(
    state: list[np.ndarray], joint_names: tuple[str, ...], calls: int
) -> dict[str, Callable[[], float]]:
    """Return functions that time one call of `crba`, `ccrba` and `rnea`, less the cost of the call [s]."""
    model = pin.buildModelFromUrdf(str(ROBOT / "ironcub.urdf"), pin.JointModelFreeFlyer())
    H, s, v, s_dot = state
    q, nu = pin.neutral(model), np.zeros(model.nv)
    q[:3], q[3:7] = H[:3, 3], pin.Quaternion(H[:3, :3]).coeffs()
    nu[:3], nu[3:6] = H[:3, :3].T @ v[:3], H[:3, :3].T @ v[3:]
    for index, name in enumerate(joint_names):
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q], nu[joint.idx_v] = s[index], s_dot[index]
    data, empty = model.createData(), pin.Model()
    nothing, none = empty.createData(), np.zeros(0)
    pairs = {
        "mass matrix": (lambda: pin.crba(model, data, q), lambda: pin.crba(empty, nothing, none)),
        "CMM": (lambda: pin.ccrba(model, data, q, nu), lambda: pin.ccrba(empty, nothing, none, none)),
        "RNEA": (lambda: pin.rnea(model, data, q, nu, nu), lambda: pin.rnea(empty, nothing, none, none, none)),
    }

    def timer(whole: Callable[[], Any], call: Callable[[], Any]) -> Callable[[], float]:
        return lambda: (timeit.timeit(whole, number=calls) - timeit.timeit(call, number=calls)) / calls

    return {name: timer(*pair) for name, pair in pairs.items()}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--skip-adam", action="store_true", help="leave out adam, which takes about a minute")
    parser.add_argument("--repeat", type=int, default=15, help="rounds of timing; the median counts")
    options = parser.parse_args()
    urdf = str(ROBOT / "ironcub.urdf")
    names = list(tomllib.loads((ROBOT / "robot.toml").read_text(encoding="utf-8"))["joints"])
    kindyn = KinDynComputations(urdf, names)

    counts = instructions(kindyn, ours=True)
    theirs: dict[str, int] = {}
    if not options.skip_adam:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from adam.casadi import KinDynComputations as Adam
        theirs = instructions(Adam(urdf, names), ours=False)
    print(f"{'instructions':32}{'ours':>10}{'adam':>10}{'ratio':>8}{'budget':>10}")
    for name, count in counts.items():
        peer = theirs.get(name)
        ratio = f"{peer / count:.1f}" if peer else ""
        print(f"{name:32}{count:10}{peer or '':>10}{ratio:>8}{BUDGET.get(name, ''):>10}")
    print("\nwhat they are: ", end="")
    print(
        *(
            f"{name} {arithmetic(function)}"
            for name, function in (
                ("mass matrix", kindyn.mass_matrix_fun()),
                ("RNEA", kindyn.rnea_fun()),
            )
        ),
        sep="; ",
    )

    rng = np.random.default_rng(0)
    state = [np.eye(4), rng.normal(size=kindyn.NDoF), rng.normal(size=6), rng.normal(size=kindyn.NDoF)]
    ours = {
        "mass matrix": (kindyn.mass_matrix_fun(), state[:2]),
        "CMM": (kindyn.centroidal_momentum_matrix_fun(), state[:2]),
        "RNEA": (kindyn.rnea_fun(), [*state, *state[2:]]),
    }
    with tempfile.TemporaryDirectory() as folder:
        mine = {name: compiled_time(*pair, Path(folder), calls=20000) for name, pair in ours.items()}
        peer = pinocchio_times(state, kindyn.joint_names, calls=5000)
        print(f"\n{'time of one call [µs]':32}{'ours':>10}{'Pinocchio':>10}{'ratio':>8}")
        for name in ours:
            rounds = [(mine[name](), peer[name]()) for _ in range(options.repeat)]
            a, b = (1e6 * median(column) for column in zip(*rounds, strict=True))
            ratio = median(first / second for first, second in rounds)
            print(f"{name:32}{a:10.2f}{b:10.2f}{ratio:8.2f}")


if __name__ == "__main__":
    main()
