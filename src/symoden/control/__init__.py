"""Controllers from the energy of a system, analytic or learned, and the closed loop that tries them."""

from ._attraction import attraction as attraction
from ._audit import (
    LyapunovAudit as LyapunovAudit,
    audit_energies as audit_energies,
    audit_energy as audit_energy,
    desired_energies as desired_energies,
    energy_rate as energy_rate,
)
from ._compiled import Compiled as Compiled
from ._controller import AbstractController as AbstractController, input_limits as input_limits
from ._design import (
    METHODS as METHODS,
    Method as Method,
    Tell as Tell,
    choose_method as choose_method,
    design as design,
    has_height as has_height,
    lowest as lowest,
    silent as silent,
)
from ._episodes import (
    Episode as Episode,
    close_loop as close_loop,
    run_episodes as run_episodes,
    run_in_turn as run_in_turn,
)
from ._files import load_controller as load_controller, save_controller as save_controller
from ._follower import Follower as Follower
from ._free import indifferent as indifferent
from ._handover import Handover as Handover
from ._ida_pbc import IdaPbc as IdaPbc, Matching as Matching
from ._judge import Tolerance as Tolerance, Verdict as Verdict, judge as judge
from ._lag import Lag as Lag
from ._lagrangian import ControlledLagrangian as ControlledLagrangian
from ._loop import MOST_PERIODS as MOST_PERIODS, Loop as Loop
from ._motion import rates_of as rates_of
from ._observer import Estimate as Estimate, Observer as Observer
from ._plan import Motion as Motion, plan_motion as plan_motion
from ._predictor import Memory as Memory, PredictorFeedback as PredictorFeedback
from ._pumps import CollocatedPump as CollocatedPump, EnergyPump as EnergyPump
from ._regulator import Regulator as Regulator, linearize as linearize
from ._shaping import EnergyShaping as EnergyShaping
from ._stuck import Stuck as Stuck, find_stuck as find_stuck
from ._tracking import Reference as Reference, Tracking as Tracking

__all__ = [
    "METHODS",
    "MOST_PERIODS",
    "AbstractController",
    "CollocatedPump",
    "Compiled",
    "ControlledLagrangian",
    "EnergyPump",
    "EnergyShaping",
    "Episode",
    "Estimate",
    "Follower",
    "Handover",
    "IdaPbc",
    "Lag",
    "Loop",
    "LyapunovAudit",
    "Matching",
    "Memory",
    "Method",
    "Motion",
    "Observer",
    "PredictorFeedback",
    "Reference",
    "Regulator",
    "Stuck",
    "Tell",
    "Tolerance",
    "Tracking",
    "Verdict",
    "attraction",
    "audit_energies",
    "audit_energy",
    "choose_method",
    "close_loop",
    "design",
    "desired_energies",
    "energy_rate",
    "find_stuck",
    "has_height",
    "indifferent",
    "input_limits",
    "judge",
    "linearize",
    "load_controller",
    "lowest",
    "plan_motion",
    "rates_of",
    "run_episodes",
    "run_in_turn",
    "save_controller",
    "silent",
]
