"""A second opinion: a plan in MuJoCo, which shares no code with the problem that was solved."""

from multimodal_to.simulation.agreement import by_mujoco, by_rnea, disagreement, random_states, states_along
from multimodal_to.simulation.controller import Command, Controller, Servos
from multimodal_to.simulation.disturbance import Disturbance, Push, draw
from multimodal_to.simulation.flight import Flight
from multimodal_to.simulation.model import SimulationModel, build_model
from multimodal_to.simulation.playback import Playback, play
from multimodal_to.simulation.report import JointTorque, Switch, Tracking, simulated_trajectory, tracking
from multimodal_to.simulation.servos import ServoController, ServoGains
from multimodal_to.simulation.trials import Draws, Trial, run_trial, run_trials
from multimodal_to.simulation.whole_body import WholeBodyController, WholeBodyGains

__all__ = [
    "Command",
    "Controller",
    "Disturbance",
    "Draws",
    "Flight",
    "JointTorque",
    "Playback",
    "Push",
    "ServoController",
    "ServoGains",
    "Servos",
    "SimulationModel",
    "Switch",
    "Tracking",
    "Trial",
    "WholeBodyController",
    "WholeBodyGains",
    "build_model",
    "by_mujoco",
    "by_rnea",
    "disagreement",
    "draw",
    "play",
    "random_states",
    "run_trial",
    "run_trials",
    "simulated_trajectory",
    "states_along",
    "tracking",
]
