"""Scenarios as data, as TOML and as texts on the command line: round trips, changes, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from multimodal_to import scenario_files, scenarios
from multimodal_to.errors import MultimodalError, OutputError, ScenarioError
from multimodal_to.models.contact import FrictionCone
from multimodal_to.models.terrain import FlatGround, HeightField, Plane, Stairs
from multimodal_to.scenarios import Start, Terminal, Weights
from multimodal_to.scenarios.data import from_dict, stored, to_dict, to_json
from multimodal_to.scenarios.margins import Margins
from synthetic import take_off as synthetic_take_off


@pytest.fixture
def scenario():
    return scenarios.take_off()


FIELD = HeightField.sampled(lambda x, y: 0.1 * x * y, x_range=(-1.0, 1.0), y_range=(-0.5, 0.5), spacing=0.3)
VARIANTS = {
    "plane": {"surface": Plane(slope=0.1, direction=(-1.0, 0.5), height=0.2), "friction": 0.5},
    "stairs": {"surface": Stairs(edges=(0.3, 0.6), heights=(0.0, 0.1, 0.2), direction=(-1.0, 0.0), width=0.05)},
    "field": {"surface": FIELD, "mid_height_min": 0.6},
    "cone": {"friction_cone": FrictionCone.SECOND_ORDER, "jets": False, "title": 'Say "é"\nand \\ more'},
}


@pytest.mark.parametrize("name", [*scenarios.SCENARIOS, *VARIANTS])
def test_a_scenario_survives_data_json_and_toml(name, tmp_path, scenario):
    whole = scenarios.find(name) if name in scenarios.SCENARIOS else replace(scenario, **VARIANTS[name])
    assert from_dict(to_dict(whole)) == whole
    assert from_dict(json.loads(to_json(whole))) == whole
    assert scenario_files.load(scenario_files.save(whole, tmp_path / "task.toml")) == whole


def test_a_short_file_says_only_what_differs_from_a_bundled_scenario(tmp_path, scenario):
    path = tmp_path / "my_task.toml"
    path.write_text(
        """
        based_on = "take-off"
        final_com_height = 0.8
        friction_cone = "second-order"
        [weights]
        thrust = 3
        joint_velocities.legs = 2e4
        [surface]
        kind = "plane"
        slope = 0.1
        """
    )
    weights = replace(scenario.weights, thrust=3.0, joint_velocities={"upper_body": 5e5, "legs": 2e4})
    assert scenario_files.load(path) == replace(
        scenario,
        name="my_task",
        final_com=(0.0, 0.0, 0.8),
        friction_cone=FrictionCone.SECOND_ORDER,
        weights=weights,
        surface=Plane(slope=0.1),
    )


def test_a_file_without_a_base_takes_the_defaults(tmp_path):
    path = tmp_path / "stand.toml"
    path.write_text(
        'title = "Stand"\nknots = 10\ninitial_com = [0, 0, 0.57]\nfinal_com = [0, 0, 0.57]\nterminal = "standing"\n'
        "interval_min = 0.1\ninterval_max = 0.1\n[weights]\nposture = 1\n"
    )
    stand = scenario_files.load(path)
    assert (stand.name, stand.knots, stand.start, stand.terminal) == ("stand", 10, Start.STANDING, Terminal.STANDING)
    assert stand.surface == FlatGround()
    assert stand.weights == Weights(posture=1.0)


def test_single_values_are_changed_by_texts(scenario):
    changed = scenario_files.change(
        scenario,
        [
            "initial_com_height = 0.55",
            "weights.thrust=3",
            "terminal=free",
            "jets=false",
            "com_range=[1, 1, 2]",
            "surface.height=.1",
        ],
    )
    assert changed == replace(
        scenario,
        initial_com=(0.0, 0.0, 0.55),
        weights=replace(scenario.weights, thrust=3.0),
        terminal=Terminal.FREE,
        jets=False,
        com_range=(1.0, 1.0, 2.0),
        surface=FlatGround(height=0.1),
    )
    assert scenario_files.change(scenario, []) == scenario


def test_another_kind_of_surface_starts_from_its_own_defaults_and_the_same_kind_from_what_was():
    base = replace(scenarios.take_off(), surface=Plane(slope=0.1, height=0.3))
    assert scenario_files.change(base, ["surface.slope=0.2"]).surface == Plane(slope=0.2, height=0.3)
    assert scenario_files.change(base, ["surface=flat"]).surface == FlatGround()


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (["knts=3"], "unknown key 'knts'; did you mean 'knots'? Available: name, title, knots"),
        (["weights.thrst=1"], "unknown key 'weights.thrst'; did you mean 'weights.thrust'?"),
        (["surface.slope=1"], "unknown key 'surface.slope'"),
        (["knots=2.5"], "'knots' is 2.5; expected a whole number"),
        (["knots=true"], "'knots' is True; expected a whole number"),
        (["jets=0"], "'jets' is 0; expected true or false"),
        (["title=3"], "'title' is 3; expected a text"),
        (["friction=much"], "'friction' is 'much'; expected a finite number"),
        (["weights.thrust=nan"], "'weights.thrust' is nan; expected a finite number"),
        (["weights=3"], "'weights' is 3; expected a table"),
        (["weights.joint_velocities=3"], "'weights.joint_velocities' is 3; expected a table"),
        (["weights.joint_velocities.legs=x"], "'weights.joint_velocities.legs' is 'x'; expected a finite number"),
        (["terminal=hoover"], "'terminal' is 'hoover'; expected one of hover, standing, free"),
        (["final_com=[0, 1]"], "'final_com' is [0, 1]; expected a list of 3"),
        (["final_com=[0, 1, 'x']"], "'final_com[2]' is 'x'; expected a finite number"),
        (["final_com=3", "final_com_height=1"], "'final_com' is 3; expected a list"),
        (["surface.kind=pane"], "'surface.kind' is 'pane'; expected one of flat, plane, stairs, height-field"),
        (["surface=3"], "'surface' is 3; expected a table with a kind"),
        (["surface=plane"], "the scenario lacks 'surface.slope'"),
        (["surface.kind=plane", "surface.slope=inf"], "'surface.slope' is inf"),
        (["surface.kind=stairs", "surface.edges=[1]", "surface.heights=[1]"], "'surface': stairs have 1 edges"),
        (["surface=flat", "surface.height=1"], "another change gives 'surface' as a whole"),
        (["knots=2"], "knots is 2; expected 3 to"),
        (["knots"], "'knots' is no change of a scenario; expected key=value"),
    ],
)
def test_a_change_that_makes_no_scenario_is_refused_by_key_and_value(scenario, settings, sentence):
    with pytest.raises(ScenarioError) as error:
        scenario_files.change(scenario, settings)
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("knots = ", "is not valid TOML"),
        ('based_on = "takeoff"', "unknown scenario 'takeoff'; did you mean 'take-off'?"),
        ("based_on = 3", "'based_on' is 3; expected the name of a bundled scenario"),
        ("knots = 5", "the scenario lacks 'title', 'interval_min'"),
        ("final_com_height = 0.8", "'final_com_height' changes 'final_com', which the scenario lacks"),
    ],
)
def test_a_file_that_makes_no_scenario_is_refused_by_its_name(tmp_path, text, sentence):
    path = tmp_path / "task.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as error:
        scenario_files.load(path)
    assert str(path) in str(error.value)
    assert sentence in str(error.value)


def test_files_that_cannot_be_read_or_written_are_named(tmp_path, scenario):
    with pytest.raises(ScenarioError, match=r"cannot read '.*none.toml'"):
        scenario_files.load(tmp_path / "none.toml")
    with pytest.raises(OutputError, match="cannot write"):
        scenario_files.save(scenario, tmp_path / "missing" / "task.toml")


def test_a_surface_of_the_users_own_class_cannot_be_written_down(scenario):
    class Bumps(FlatGround):
        pass

    with pytest.raises(ScenarioError, match="a Bumps cannot be written down as the surface of a scenario; expected"):
        to_dict(replace(scenario, surface=Bumps()))


def test_a_trajectory_keeps_its_scenario_as_text_in_its_file(ironcub, scenario, tmp_path):
    bare = synthetic_take_off(ironcub)
    assert stored(bare) is None
    kept = replace(scenario, **VARIANTS["field"])
    trajectory = replace(bare, scenario_json=to_json(kept))
    assert stored(type(bare).load(trajectory.save(tmp_path / "motion.npz"))) == kept


@pytest.mark.parametrize("text", ["{", "[]", "3", '{"knots": 5}', '{"colour": "red"}'])
def test_a_kept_text_that_is_no_scenario_is_refused(ironcub, text):
    with pytest.raises(MultimodalError, match="the scenario kept with 'take-off & hover' cannot be read"):
        stored(replace(synthetic_take_off(ironcub), scenario_json=text))


def test_a_motion_of_before_the_margins_was_not_asked_for_any(ironcub, scenario):
    plain = to_dict(scenario)
    assert plain["margins"]["torque"] == Margins().torque > 0.0
    motion = synthetic_take_off(ironcub)

    def kept(**change):
        return stored(replace(motion, scenario_json=json.dumps({**plain, **change})))

    assert kept() == scenario
    assert kept(margins={"pressure": 0.5}) == replace(scenario, margins=replace(Margins.none(), pressure=0.5))
    del plain["margins"]
    assert kept() == replace(scenario, margins=Margins.none())
    assert from_dict(plain) == scenario  # a task that is written today and says nothing has them
    with pytest.raises(ScenarioError, match="margins"):
        kept(margins=3.0)
