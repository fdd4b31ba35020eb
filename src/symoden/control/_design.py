"""Make a controller from a model by name: what a user picks up."""

from collections.abc import Callable
from typing import Final, Literal, TypeAlias, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian, potential, refuse_no_system
from symoden.shapes import Coordinates, Scalar

from ._attraction import attraction, by_stiffness, follower_level, simulated_period
from ._causes import why_not_held
from ._controller import AbstractController, Limits, Target, as_array, input_limits
from ._episodes import run_episodes
from ._follower import Follower
from ._free import anchored, check_free, free_of, told, weightless
from ._handover import Handover
from ._ida_pbc import IdaPbc
from ._judge import Tolerance
from ._lagrangian import ControlledLagrangian
from ._plan import plan_motion
from ._pumps import CollocatedPump, EnergyPump, actuated_coordinate, is_direct
from ._regulator import Regulator
from ._sampling import check_period
from ._scales import bandwidth, configurations, energy_range, slow_friction, static_load
from ._search import SEARCHED, searched
from ._shaping import EnergyShaping
from ._tracking import Reference, Tracking

Method: TypeAlias = Literal[
    "energy-shaping", "energy-shaping+lqr", "ida-pbc", "controlled-lagrangian", "swing-up", "tracking", "lqr"
]
"""Name of a way to make a controller."""
METHODS: Final[tuple[Method, ...]] = get_args(Method)
"""Names of all methods."""
Tell: TypeAlias = Callable[[str], None]
"""Called with a line of text about what is being done."""

_STARTS: Final = 16
_NEWTON: Final = 5
_LEISURE: Final = 0.63  # Of the system's own rate [rad/s].
_FLAT: Final = 1e-2  # Curvature, relative to the largest.
_FLAT_WORK: Final = 1e-3  # Range of V, relative to what the inputs do along 1 rad.


def silent(text: str) -> None:
    """Tell nobody.

    Args:
        text: What would be told.
    """
    del text


def design(
    model: AbstractDynamics,
    target: Target,
    *,
    method: Method | None = None,
    limits: Limits = None,
    period: float | None = None,
    reference: Reference | None = None,
    tell: Tell = silent,
) -> AbstractController:
    """Make a controller that brings a system to rest at a configuration.

    Args:
        model: System or learned model; a model without energy allows "lqr" only.
        target: Configuration to go to; for "lqr" and "swing-up" NaN along coordinates that are free, that need not come
            to rest anywhere, such as the angle of a reaction wheel.
        method: How; `choose_method` decides if absent.
        limits: Largest magnitude of the inputs, one number or one for each; None for none.
        period: Control period [s] that regulators are optimal for, that bounds gains, and that must be short enough for
            laws made for continuous control; None for that.
        reference: q_d(t) for "tracking"; a slow swing about the target if absent.
        tell: Called with what is being done, where that takes long.

    Returns:
        The controller.

    Raises:
        TypeError: If the model is none.
        ValueError: If the target is no configuration, the method does not suit the model, it needs limits that are not
            given, or the period is too long for it.

    Example:
        >>> from symoden.systems import Pendulum
        >>> controller = design(Pendulum(), [jnp.pi], limits=15.0)
        >>> type(controller).__name__, type(controller.far).__name__
        ('Handover', 'EnergyShaping')
    """
    refuse_no_system(model)
    _check_target(model, target, method)
    chosen = choose_method(model, target, limits=limits) if method is None else method
    if chosen == "lqr":
        tell("trying how stiff the regulator must be")
        return by_stiffness(model, target, limits=limits, period=period)[0]
    if not isinstance(model, AbstractPortHamiltonian):
        raise ValueError(f"The method {chosen!r} needs a model with an energy; got {type(model).__name__}. Use 'lqr'.")
    match chosen:
        case "energy-shaping":
            controller = EnergyShaping.of(model, target, limits=limits, period=period)
        case "energy-shaping+lqr":
            far = design(model, target, method="energy-shaping", limits=limits, period=period)
            return _with_regulator(model, far, as_array(target), limits=limits, period=period, tell=tell)
        case "tracking":
            controller = Tracking.of(model, reference or slow_swing(model, as_array(target)), limits=limits)
        case "ida-pbc":
            tell("solving the matching conditions")
            controller = IdaPbc.of(model, target, limits=limits)
        case "controlled-lagrangian":
            tell("searching gains on the linearised closed loop")
            controller = ControlledLagrangian.of(model, target, limits=limits)
        case "swing-up":
            return _swing_up(model, as_array(target), limits=limits, period=period, tell=tell)
        case _:
            raise ValueError(f"`method` must be one of {', '.join(METHODS)}; got {chosen!r}.")
    if period is not None:
        check_period(model, controller, as_array(target), period, method=chosen)
    return controller


def _check_target(model: AbstractDynamics, target: Target, method: Method | None) -> None:
    """Refuse a target of another size, and one that leaves free what weight depends on, or the method needs."""
    goal = as_array(target)
    if goal.shape != (model.space.size,):
        raise ValueError(
            f"`target` must be a list of one number for each coordinate, {model.space.size}; got shape {goal.shape}."
        )
    check_free(model, goal)
    if free_of(goal).any() and method not in {None, "lqr", "swing-up"}:
        raise ValueError(f"The method {method!r} needs a place for each coordinate; swing-up and lqr leave some free.")


def choose_method(model: AbstractDynamics, target: Target, *, limits: Limits = None) -> Method:
    """Method that suits a system: energy shaping where the inputs can carry it everywhere, or swing-up of angles.

    Args:
        model: System or model.
        target: Configuration to go to; NaN along coordinates that are free.
        limits: Largest magnitude of the inputs.

    Returns:
        The method; "lqr" for a model without energy, or without an angle to swing up.
    """
    if not isinstance(model, AbstractPortHamiltonian):
        return "lqr"
    goal = as_array(target)
    free = free_of(goal)
    if model.inputs == model.space.size and not free.any() and _is_strong(model, goal, limits):
        return "energy-shaping+lqr"
    if free.any() and not (is_direct(model, goal) or _rides(model, anchored(goal))):
        return "lqr"  # Motions are planned to whole configurations.
    return "swing-up" if (model.space.is_angle & ~free).any() else "lqr"


def _is_strong(model: AbstractPortHamiltonian, target: Coordinates, limits: Limits) -> bool:
    """Whether inputs, one for each coordinate, lift the weight anywhere, and move it with half of what it leaves."""
    # That half is what energy shaping pushes with far from its target. Of less weight than friction nothing is swung
    # up, and no other method pushes harder.
    load = static_load(model, target)
    drag = slow_friction(model, target, as_array(Tolerance().velocity))
    friction = np.abs(np.linalg.pinv(np.asarray(model.input_matrix(target)))) @ np.asarray(drag)
    return bool(np.all(input_limits(limits, model.inputs) > load + np.where(load > friction, 2 * friction, 0.0)))


def _with_regulator(
    model: AbstractPortHamiltonian,
    far: AbstractController,
    target: Coordinates,
    *,
    limits: Limits,
    period: float | None,
    tell: Tell,
) -> AbstractController:
    """A controller, and near its target a regulator where one holds the model there."""
    tell("simulating the model under its regulator")
    try:
        near, level = _regulator_and_level(model, target, limits=limits, period=period)
    except ValueError as error:  # The period leaves none, or rounding.
        tell(f"energy shaping alone, as there is no regulator: {error}")
        return far
    if level:
        return Handover(far=far, near=near, level=as_array(level), limits=near.limits)
    tell("energy shaping alone, as no regulator holds the model at the target")
    return far


def slow_swing(model: AbstractPortHamiltonian, target: Coordinates) -> Reference:
    """Reference that swings about a configuration by half a radian or metre, more slowly than the system would.

    Args:
        model: System or model.
        target: Middle of the motion.

    Returns:
        q_d(t).
    """
    omega = _LEISURE * bandwidth(model, target)
    lag = jnp.arange(model.space.size, dtype=target.dtype)

    def reference(t: Scalar) -> Coordinates:
        return target + 0.5 * jnp.sin(omega * t + lag)

    return reference


def _swing_up(
    model: AbstractPortHamiltonian, target: Coordinates, *, limits: Limits, period: float | None, tell: Tell
) -> Handover:
    """Energy where it suffices, a planned motion otherwise; then a regulator."""
    if not np.isfinite(input_limits(limits, model.inputs)).all():
        raise ValueError("Swing-up needs limits of the inputs: what would be planned without them has no bound.")
    goal = anchored(target)
    if not has_height(model, goal, limits=limits):
        raise ValueError(
            f"Swing-up needs angles that weight pulls down; along those of {model.space} the potential energy is flat. "
            "Use energy-shaping, or lqr where an input is missing."
        )
    tell("simulating the model under its regulator")
    near, level = _regulator_and_level(model, target, limits=limits, period=period)
    if level == 0:
        raise ValueError(why_not_held(model, near, period))

    def hand_over(far: AbstractController) -> Handover:
        return Handover(far=far, near=near, level=as_array(level), limits=near.limits)

    if is_direct(model, target):
        return hand_over(EnergyPump.of(model, target, limits=limits))
    if _rides(model, goal):
        tell("searching swing-up gains on the model")
        starts = _anywhere(model, goal)
        pumped = searched(model, hand_over(CollocatedPump.of(model, target, limits=limits)), *starts)
        if _arrives(model, pumped, *starts):
            return pumped
    if free_of(target).any():
        raise ValueError(
            f"No swing-up to {told(target)} was found on the model, and motions are planned to whole configurations "
            "alone. Give a place for each coordinate, or use lqr from near the target."
        )
    tell("planning a motion on the model")
    motion = plan_motion(model, lowest(model, target), target, limits=limits)
    follower = Follower.of(model, motion, near)
    tell("simulating the model along the planned motion")
    whole = hand_over(follower)
    return eqx.tree_at(
        lambda c: c.far.level, whole, as_array(follower_level(model, whole, period=simulated_period(period)))
    )


def _regulator_and_level(
    model: AbstractPortHamiltonian, target: Coordinates, *, limits: Limits, period: float | None
) -> tuple[Regulator, float]:
    """The softest regulator that holds the model near its target, and up to which cost to go; zero if none does."""
    regulators = by_stiffness(model, target, limits=limits, period=period)
    tried = ((each, attraction(model, each, period=simulated_period(period))) for each in regulators)
    return next((each for each in tried if each[1] > 0), (regulators[0], 0.0))


def has_height(model: AbstractPortHamiltonian, target: Target, *, limits: Limits) -> bool:
    """Whether weight pulls angles down, so that there is something to swing up.

    Args:
        model: System or model.
        target: Configuration to go to; NaN along coordinates that are free.
        limits: Largest magnitude of the inputs.

    Returns:
        Whether V along the angles ranges over more than a thousandth of what the inputs do along 1 rad.
    """
    goal = anchored(as_array(target))
    angles = np.array(model.space.is_angle)
    torques = np.abs(np.asarray(model.input_matrix(goal)))[angles] @ input_limits(limits, model.inputs)
    return bool(energy_range(model, goal) > _FLAT_WORK * torques.max(initial=0.0))


def _rides(model: AbstractPortHamiltonian, target: Coordinates) -> bool:
    """Whether two coordinates have one input, on the one that the potential energy does not depend on."""
    if model.space.size != 2 or model.inputs != 1:
        return False
    return bool(weightless(model, target)[actuated_coordinate(model, target)])


def _anywhere(
    model: AbstractPortHamiltonian, target: Coordinates
) -> tuple[Float[np.ndarray, "k n"], Float[np.ndarray, "k n"]]:
    """States to try a swing-up from: angles anywhere, lengths within half a metre, half the natural speed."""
    generator = np.random.default_rng(1)
    n = model.space.size
    size = np.where(model.space.is_angle, np.pi, 0.5)
    q = np.asarray(target) + generator.uniform(-1, 1, (_STARTS, n)) * size
    speed = np.where(model.space.is_angle, 0.5 * bandwidth(model, target), 0.0)
    return q, generator.uniform(-1, 1, (_STARTS, n)) * speed


def _arrives(
    model: AbstractPortHamiltonian,
    controller: Handover,
    q0: Float[np.ndarray, "k n"],
    v0: Float[np.ndarray, "k n"],
) -> bool:
    """Whether the model comes to where the regulator takes over, from any of the states that lie elsewhere."""
    episodes = run_episodes(model, controller, q0, v0, SEARCHED)
    cost = jax.vmap(controller.near.desired_energy)
    outside = cost(episodes.q[:, 0], episodes.v[:, 0]) >= controller.level
    return bool((outside & (cost(episodes.q[:, -1], episodes.v[:, -1]) < controller.level)).any())


def lowest(model: AbstractPortHamiltonian, target: Coordinates) -> Coordinates:
    """Configuration of the lowest potential energy; lengths and what that does not depend on are as in the target.

    Args:
        model: System or model.
        target: Where these are.

    Returns:
        The configuration.
    """
    q = configurations(model, target)
    start = q[jnp.argmin(jax.vmap(lambda q: potential(model, q))(q))]
    start = jnp.where(weightless(model, target), target, start)
    angles = np.asarray(model.space.angles)

    def height(free: Float[Array, " a"]) -> Scalar:
        return potential(model, start.at[angles].set(free))

    free = start[angles]
    for _ in range(_NEWTON):  # Along an angle that V hardly depends on there is nowhere to go.
        free = free - jnp.linalg.pinv(jax.hessian(height)(free), rtol=_FLAT, hermitian=True) @ jax.grad(height)(free)
    return start.at[angles].set(jnp.where(height(free) < height(start[angles]), free, start[angles]))
