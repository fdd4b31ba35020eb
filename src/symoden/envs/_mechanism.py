"""Anything that can be rolled out, as a Gymnasium environment."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import gymnasium
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Float64

from symoden.drawing import Picture, draw_chain, draw_coordinates
from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates
from symoden.systems import AbstractPlanarMechanism

from ._motion import Motion, Mover
from ._settings import Bounds, bounds, start_of, vector

if TYPE_CHECKING:
    from ._window import Window

Observed: TypeAlias = Float32[np.ndarray, " o"]
Action: TypeAlias = np.ndarray | Sequence[float]
Info: TypeAlias = dict[str, Any]
Places: TypeAlias = Callable[[Coordinates], Float[Array, "k 2"]]

# What a squared rate and a squared input cost beside the squared distance: as in Gymnasium's `Pendulum-v1`.
_RATE_COST: Final = 0.1
_INPUT_COST: Final = 0.001
_USUAL_START: Final = {False: (-0.5, 0.5), True: (-np.pi, np.pi)}


@dataclass(eq=False, repr=False)
class MechanismEnv(gymnasium.Env[Observed, Action]):
    """Analytic system or trained model under held inputs, to be brought to a target and held there.

    An action is the inputs themselves [N or N m], clipped to their limits and held for a control period. An
    observation is the embedded configuration (r, cos φ, sin φ), then the rates. The reward of a step is

        −|q − target|² − 0.1 |rates|² − 0.001 |u|²,   angles the short way round, after the step.

    `info` has the measured "q", angles in [-π, π), and "v" (or "p", where the dynamics' data are momenta); after a step
    it has "u", the inputs that acted. `reset(options={"q": …, "v": …})` starts at a given place. The state is kept in
    double precision, whatever JAX's settings.

    Episodes end (`terminated`) only where a length leaves the `track`, or a learned model diverges; the mechanism is
    then left at its last finite state. Processes of their own, as `gymnasium.vector.AsyncVectorEnv` starts them, must
    be spawned (`context="spawn"`): JAX does not survive a fork.

    Attributes:
        dynamics: What moves: a system, or a model such as `symoden.load("runs/arm/model.safetensors")`.
        dt: Control period [s]; 0.05 s is the paper's sampling interval.
        substeps: RK4 steps in it.
        max_input: Largest size of each input, one for all or one each; the paper's data have 2.
        target: Configuration to be reached; all zeros if absent.
        noise: Standard deviation of the measured q and rates, one for all or one each.
        position_bounds: Lowest and highest first value of each coordinate; lengths ±0.5, angles anywhere if absent.
        rate_bounds: The same of each rate; ±1 if absent.
        track: Largest size of a length; no limit if absent.
        points: Places of the joints as a function of q, for pictures of a learned model, such as `CartPole().points`.
            Where they are not known, pictures show a dial for each angle and a slider for each length.
        size: Width and height of pictures [pixels].
        render_mode: "rgb_array", "human" or nothing.

    Example:
        >>> from symoden.systems import Pendulum
        >>> env = MechanismEnv(Pendulum(damping=0.1), max_input=2.0)
        >>> observation, info = env.reset(seed=0, options={"q": [0.0], "v": [0.0]})
        >>> observation.tolist()
        [1.0, 0.0, 0.0]
        >>> observation, reward, terminated, truncated, info = env.step([9.0])
        >>> info["u"].tolist(), terminated
        ([2.0], False)
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 20}  # noqa: RUF012 - as Gymnasium has it

    dynamics: AbstractDynamics
    _: KW_ONLY
    dt: float = 0.05
    substeps: int = 4
    max_input: float | Sequence[float] = 2.0
    target: Sequence[float] | None = None
    noise: float | Sequence[float] = 0.0
    position_bounds: Bounds | None = None
    rate_bounds: Bounds | None = None
    track: float | None = None
    points: Places | None = None
    size: tuple[int, int] = (480, 480)
    render_mode: str | None = None

    def __post_init__(self) -> None:
        """Make the spaces, and refuse settings that no mechanism has.

        Raises:
            ValueError: If a number is out of range, or there are too many or too few.
        """
        space, n = self.dynamics.space, self.dynamics.space.size
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise ValueError(f"`dt` must be a positive number of seconds; got {self.dt}.")
        if self.track is not None and not self.track > 0:
            raise ValueError(f"`track` must be positive; got {self.track}.")
        if self.render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f'`render_mode` must be "rgb_array", "human" or None; got {self.render_mode!r}.')
        self._noise = vector("noise", self.noise, 2 * n)
        target = vector("target", 0.0 if self.target is None else self.target, n)
        self._mover = Mover(self.dynamics, RK4(self.substeps), target)
        starts = bounds("position_bounds", self.position_bounds or [_USUAL_START[angle] for angle in space.is_angle], n)
        self._starts = np.concatenate([starts, bounds("rate_bounds", self.rate_bounds or [(-1.0, 1.0)] * n, n)])
        self._rates = "p" if self.dynamics.momenta else "v"
        self._motion: Motion | None = None
        self._window: Window | None = None
        self._periods = 0
        free = np.repeat([np.inf, 1.0, np.inf], [len(space.lengths), 2 * len(space.angles), n])
        self.observation_space = _box(free)
        inputs = _box(vector("max_input", self.max_input, self.dynamics.inputs, positive=True))
        self._limits, self.action_space = inputs.high.astype(np.float64), inputs
        self.metadata = {**self.metadata, "render_fps": max(1, round(1 / self.dt))}

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[Observed, Info]:
        """Start an episode.

        Args:
            seed: Seed of the starts and of the noise from here on.
            options: "q" and "v" (or "p") to start at, instead of drawing them.

        Returns:
            The observation, and the measured coordinates and rates.

        Raises:
            ValueError: If an option is unknown or does not fit.
        """
        gymnasium.Env.reset(self, seed=seed)
        q, rates = np.split(start_of(options or {}, self._starts, ("q", self._rates), self.np_random), 2)
        self._motion, self._periods = self._mover.begin(q, rates, self._disturbance()), 0
        if self.render_mode == "human":
            self.render()
        return self._seen(self._motion)

    def step(self, action: Action) -> tuple[Observed, float, bool, bool, Info]:
        """Let inputs act for a control period.

        Args:
            action: The inputs [N or N m]; beyond a limit, the limit acts.

        Returns:
            Observation, reward, whether the episode is over, False, and the measured coordinates, rates and inputs.

        Raises:
            ValueError: If the action is no vector of so many numbers.
            ResetNeeded: If there is no episode yet.
        """
        before = self._started("step")
        u = np.clip(vector("action", action, self.dynamics.inputs), -self._limits, self._limits)
        ts = self.dt * np.array([self._periods, self._periods + 1])
        after = self._mover.advance(before.state, ts, u, self._disturbance())
        diverged = not np.isfinite(after.state).all()
        self._motion, self._periods = before if diverged else after, self._periods + 1
        if self.render_mode == "human":
            self.render()
        observation, info = self._seen(self._motion)
        terminated = bool(diverged or self._is_off_track(self._motion))
        return observation, self._reward(self._motion, u), terminated, False, info | {"u": u}

    def render(self) -> Picture | None:
        """Draw the mechanism where it is.

        Returns:
            The picture if `render_mode` is "rgb_array"; nothing otherwise.

        Raises:
            ResetNeeded: If there is no episode yet.
        """
        motion = self._started("render")
        if self.render_mode is None:
            gymnasium.logger.warn('`render` draws only if `render_mode` is "rgb_array" or "human"; got None.')
            return None
        picture = self._picture(motion.q)
        if self.render_mode == "rgb_array":
            return picture
        if self._window is None:
            from ._window import Window

            self._window = Window(str(self.spec.id if self.spec else "symoden"), self.metadata["render_fps"])
        self._window.show(picture)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _started(self, method: str) -> Motion:
        """The motion of an episode that has begun."""
        if self._motion is None:
            raise gymnasium.error.ResetNeeded(f"An episode must be started before `{method}`; call `reset()`.")
        return self._motion

    def _disturbance(self) -> Float64[np.ndarray, " k"]:
        """What the measurement adds to q and the rates."""
        return self._noise * self.np_random.standard_normal(len(self._noise))

    def _seen(self, motion: Motion) -> tuple[Observed, Info]:
        """Observation and info; nothing in them is shared with another step."""
        info = {"q": motion.measured_q.copy(), self._rates: motion.measured_rates.copy()}
        return motion.observation.astype(np.float32), info

    def _is_off_track(self, motion: Motion) -> bool:
        """Whether a length is larger than it may be."""
        return self.track is not None and bool((np.abs(motion.q[self.dynamics.space.lengths]) > self.track).any())

    def _reward(self, motion: Motion, u: Float64[np.ndarray, " m"]) -> float:
        """Reward of having arrived somewhere by some inputs."""
        away, rates = motion.away, motion.rates
        return -float(away @ away + _RATE_COST * rates @ rates + _INPUT_COST * u @ u)

    def _picture(self, q: Float64[np.ndarray, " n"]) -> Picture:
        """Links where their places are known, dials and sliders otherwise."""
        is_angle, places = self.dynamics.space.is_angle, self.points
        if places is None and isinstance(self.dynamics, AbstractPlanarMechanism):
            places = self.dynamics.points
        if places is None:
            return draw_coordinates(q, is_angle, span=self.track or 2.0, size=self.size)
        points = np.asarray(places(jnp.asarray(q, float)), np.float64)
        return draw_chain(points, cart=not is_angle[0], track=self.track, size=self.size)


def _box(limits: Float64[np.ndarray, " k"]) -> gymnasium.spaces.Box:
    """Vectors whose entries lie between limits on either side."""
    high = limits.astype(np.float32)
    return gymnasium.spaces.Box(-high, high, dtype=np.float32)
