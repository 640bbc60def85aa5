"""All URDFs of `example-robot-data` and `icub-models`: they load, or are refused for what is really wrong with them."""

from __future__ import annotations

from functools import cache
from importlib import metadata
from pathlib import Path

import pinocchio as pin
import pytest
from test_adam_pinocchio import largest_errors

from adam_robots import Peer, example_robots, random_states
from multimodal_to.adam import KinDynComputations, Tree, load_tree
from multimodal_to.errors import ModelError

REFUSED = {
    "romeo_laas_small.urdf": r"'base_link' .* has an inertia with the negative principal value -0.0213",
    "ur3.urdf": "holds no links",
    "alex_psyonic_hands.urdf": "'Left_index_q2' mimics an unknown joint 'index_q1'; did you mean 'Left_index_q1'",
}
"""What cannot be a robot: a negative inertia, no links, and a mimic joint of another that does not exist."""
FOLLOWERS = {
    "baxter.urdf": 2,
    "panda.urdf": 1,
    "panda_collision.urdf": 1,
    "pr2.urdf": 10,
    "romeo.urdf": 22,
    "talos_full_v2.urdf": 12,
    "talos_full_v2_box.urdf": 12,
    "tiago_pro.urdf": 10,
}
"""The robots with mimic joints that move, and how many."""
MASSLESS = {"romeo.urdf": "joint 'LHand' moves nothing that has mass"}
TOLERANCE = 1e-12  # of the largest entry, or of 1


def icub_models() -> list[Path]:
    distribution = metadata.distribution("icub-models")
    files = [file for file in distribution.files or [] if file.name == "model.urdf"]
    return sorted(Path(str(distribution.locate_file(file))).resolve() for file in files)


def name(urdf: Path) -> str:
    return urdf.parent.name if urdf.name == "model.urdf" else urdf.name


EXAMPLES = sorted(example_robots().rglob("*.urdf"))
EVERY = [*icub_models(), *EXAMPLES]
MIMICS = [urdf for urdf in EXAMPLES if urdf.name in FOLLOWERS]


@cache
def tree(urdf: Path) -> Tree:
    return load_tree(urdf)


def test_there_are_as_many_as_promised() -> None:
    assert len(EVERY) >= 85
    assert {urdf.name for urdf in MIMICS} == set(FOLLOWERS)


@pytest.mark.parametrize("urdf", EVERY, ids=name)
def test_every_urdf_is_the_robot_of_pinocchio_or_refused_for_what_is_wrong(urdf: Path) -> None:
    if urdf.name in REFUSED:
        with pytest.raises(ModelError, match=REFUSED[urdf.name]):
            tree(urdf)
        return
    model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    assert {*tree(urdf).joint_names, *tree(urdf).followers} == set(model.names[2:])
    assert len(tree(urdf).followers) == FOLLOWERS.get(urdf.name, 0)
    assert tree(urdf).total_mass == pytest.approx(pin.computeTotalMass(model), rel=1e-12)


@pytest.mark.parametrize("urdf", MIMICS, ids=name)
def test_with_mimic_joints_every_quantity_is_pinocchios_reduced_by_them(urdf: Path) -> None:
    kindyn = KinDynComputations(urdf)
    errors = largest_errors(kindyn, Peer(urdf, kindyn.tree), random_states(kindyn.NDoF, 2, seed=8), least=1.0)
    assert ("aba" in errors) == (urdf.name not in MASSLESS)
    assert len(errors) >= 18
    assert {what: error for what, error in errors.items() if not error < TOLERANCE} == {}


@pytest.mark.parametrize("urdf", [urdf for urdf in MIMICS if urdf.name in MASSLESS], ids=name)
def test_a_joint_that_moves_no_mass_with_its_followers_has_no_acceleration(urdf: Path) -> None:
    kindyn = KinDynComputations(urdf)
    with pytest.raises(ModelError, match=MASSLESS[urdf.name]):
        kindyn.aba_fun()
