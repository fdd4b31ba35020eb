"""Which stages training goes through, in which order, and what each must gain to be kept."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Final

from symoden.blocks import ACTUATION, DIRECTIONS, FRICTION, INERTIA, NETWORKS, POTENTIAL, count_parameters, kinds_in_use
from symoden.data import Dataset
from symoden.mechanics import AbstractDynamics
from symoden.models import StructuredModel, energies_are_given

from ._adam_stage import AdamStage
from ._beginnings import Again, Best, Joined, Refitted, Uniform, Untrained, Without
from ._config import TrainingConfig
from ._data import (
    LONGER,
    Data,
    across_recordings,
    adam_data,
    levenberg_data,
    longer_data,
    name_short,
    name_thinned,
    regression_data,
)
from ._gauss_newton import MOST_PARAMETERS
from ._late_inputs import LateInputs, varying
from ._levenberg_stage import LevenbergStage
from ._stages import AbstractStage
from ._verdicts import CHANCE, CLEAR
from ._weak_form import has_weak_form
from ._weighing import Errors

_MANY: Final = 3  # Coordinates.


def line_up(
    dataset: Dataset,
    dynamics: AbstractDynamics,
    candidates: Sequence[AbstractDynamics],
    config: TrainingConfig,
    *,
    regress_first: bool = False,
) -> list[AbstractStage]:
    """Cut the recordings into windows, and line up the stages.

    Args:
        dataset: Recordings, with their validation part.
        dynamics: Untrained model.
        candidates: Untrained models like it, from whose weights Adam starts in turn; without any, it is left out.
        config: Settings.
        regress_first: Whether a regression comes first, as it does on many coordinates.

    Returns:
        The stages.
    """
    free = count_parameters(dynamics, corrections=0) > 0  # Else every part is given, and some are corrected.
    stages: list[AbstractStage] = []
    weak = regression_data(dataset, dynamics, config) if free and can_regress(dynamics, config) else None
    first = weak is not None and (regress_first or dynamics.space.size >= _MANY)
    if weak is not None and first:
        stages.extend(_regression(dynamics, weak, config))
    elif weak is not None and not candidates:
        stages.append(LevenbergStage(weak, config, "regression", config.lm_steps))
    if candidates and free:
        data = adam_data(dataset, dynamics, config)
        name_short(dataset, data)
        count = len(candidates)
        names = [f"adam {k + 1} of {count}" for k in range(count)] if count > 1 else ["adam"]
        stages.extend(
            AdamStage(
                data,
                config,
                name,
                config.adam_steps,
                fresh,
                yields=first or bool(kinds_in_use(fresh) & POTENTIAL),
            )
            for name, fresh in zip(names, candidates, strict=True)
        )
        if weak is not None and not first and config.scaled_loss:
            stages.extend(_regression(dynamics, weak, config, data, after=len(stages)))
    if config.lm_steps:
        data = levenberg_data(dataset, dynamics, config)
        name_short(dataset, data)
        name_thinned(dataset, data, config)
        if free:
            guess = dynamics if weak is not None and not candidates else None
            simple = LevenbergStage(
                data, config, "levenberg-marquardt", config.lm_steps, begins=Best(guess), widens=not first
            )
            stages.append(simple)
            if config.growth_steps and config.scaled_loss and dynamics.space.size <= _MANY and varying(dataset):
                laws = _laws(dynamics, config)
                stages.append(LateInputs(dataset, simple, laws if _fits(dynamics, laws) else 0))
        longer = longer_data(dataset, dynamics, data, config)
        stages.extend(_further(dynamics, data, longer, config, answered=first and energies_are_given(dynamics)))
        longest = [data, *longer][-1]._replace(in_turn=False)  # Thousands of numbers keep what they were taught.
        stages.extend(_growth(dataset, dynamics, longest, config, after=len(stages)))
    return stages


def can_regress(dynamics: AbstractDynamics, config: TrainingConfig) -> bool:
    """Whether there is a weak form of the equations of motion, and second-order steps are wanted.

    Args:
        dynamics: Untrained model.
        config: Settings.

    Returns:
        Whether it is so.
    """
    return isinstance(dynamics, StructuredModel) and config.lm_steps > 0 and has_weak_form(dynamics)


def _regression(
    dynamics: AbstractDynamics, data: Data, config: TrainingConfig, rollouts: Data | None = None, *, after: int = 0
) -> list[LevenbergStage]:
    """Regression of the equations of motion in weak form: nearly linear, it needs no good start.

    On three coordinates and more it comes before Adam, and saves it. On fewer Adam does as well, and tells friction
    better; but where noise hides what moves in Adam's short windows, it ends on a plateau, with a mass so large that
    nothing matters, and where dry friction holds joints between short moves, in a wrong basin. Then the regression
    begins anew. Without Adam, from what a user guessed, it comes first alone, without priors that are learned: from
    guesses four times off, rollouts alone ended elsewhere in four cases of ten (`benchmarks/`).

    Returns:
        The stages.
    """
    begins = Best() if rollouts is None else Untrained(dynamics)
    first = LevenbergStage(data, config, "regression", config.lm_steps, begins=begins, rollouts=rollouts)
    further = _further(dynamics, data, (), config, regression=True)
    return [first, *(dataclasses.replace(stage, after=after) for stage in further)]


def _further(
    dynamics: AbstractDynamics,
    data: Data,
    longer: Sequence[Data],
    config: TrainingConfig,
    *,
    regression: bool = False,
    answered: bool = False,
) -> list[LevenbergStage]:
    """What is asked for one by one (`_asked`), what of all that is needed, and longer windows.

    Where priors are learned, friction's laws are free whatever was said of them before: a few windows of validation
    refuse dry friction that is there. What they refused begins with narrow priors, which the evidence must widen.
    What depends on the direction is not, unless validation asked for it: on a measured arm
    whose encoders have another zero in every recording it took up what these leave, and a recording held out was
    predicted worse. In longer windows priors go on from what shorter ones taught: with wide ones again, noise would
    fill what these had closed. Errors that they were learned beside are then gone: a refit follows, in which they fade
    with the loss.

    What comes after longer windows goes by the longest: short ones would undo what these find.

    More than `MOST_PARAMETERS` are too many: priors then stay as wide as they are.

    Returns:
        The stages.
    """
    grow, learn = config.growth_steps, config.relevance_steps
    judged = _laws(dynamics, config)
    learns = learn > 0 and _fits(dynamics, judged)
    of = "regression: " if regression else ""
    stages = _asked(dynamics, data, config, regression=regression, answered=answered)
    turns = any(stage.corrections & ACTUATION for stage in stages)
    errors = Errors.ALIKE if regression else Errors.AS_FOUND  # Under bumps they are independent.
    goes_on = functools.partial(LevenbergStage, config=config, corrections=judged, errors=errors)
    if learns:
        relevance = goes_on(data, name=f"{of}relevance", steps=learn, margin=-CHANCE, learns=True)
        if not regression and data.validation is not None:
            stages += _both_ways(relevance, stiff=data.in_turn or energies_are_given(dynamics))
        else:
            stages.append(relevance)
    if not grow:
        return stages
    anew = turns and regression and not energies_are_given(dynamics)  # What is given cannot be bent.
    if anew and data.validation is not None:  # Without, it would be kept whatever it is.
        stages.append(_actuation_anew(dynamics, data, config, learns=learns))
    again = (learn + 1) // 2 if learns else grow  # At a factor of three a step priors are through in 17.
    # Else every part is given, and nothing is free before networks are.
    if stages or count_parameters(dynamics, corrections=judged):
        stages.extend(
            goes_on(
                each,
                name=f"longer windows {times}x",
                steps=again,
                margin=-CHANCE if each.hardly_validated else -CLEAR,  # Few windows never speak clearly.
                learns=learns,
            )
            for times, each in zip(LONGER, longer, strict=False)
        )
    longest = longer[-1] if longer else data
    if learns:
        stages.append(goes_on(longest, name=f"{of}refit", steps=grow, margin=CLEAR))
    return stages


def _both_ways(relevance: LevenbergStage, *, stiff: bool) -> list[LevenbergStage]:
    """Priors learned beside errors as they are, and beside what is new in them, from the same model on.

    Disturbances that no model knows make errors alike, and whitened ones then tell many numbers better: of measured
    arms that were learned whole, recordings held out were predicted to 0.03 rad for 0.04. But so does what a model
    lacks, and is no noise: three numbers of a propeller's arm that follows its input slowly missed 3.4 rad of their own
    recording by whitened errors, 0.07 rad without. Few numbers scatter little, and lack more.

    Args:
        relevance: The stage.
        stiff: Whether few numbers are learned.

    Returns:
        Both stages.
    """
    whitened = dataclasses.replace(
        relevance,
        name="whitened errors",
        margin=-CHANCE if stiff else -CLEAR,
        errors=Errors.WHITENED,
        begins=Again(),
    )
    return [dataclasses.replace(relevance, errors=Errors.ALIKE), whitened]


def _asked(
    dynamics: AbstractDynamics, data: Data, config: TrainingConfig, *, regression: bool, answered: bool
) -> list[LevenbergStage]:
    """Corrections that are asked for one by one: of inertia, inputs and V; friction's laws, and directions.

    Whether the inertia depends on lengths, and how inputs act from configuration to configuration comes first: an M or
    g that is constant where it must not be spoils all else. Of vehicles and carts M is the same wherever they are;
    where it might differ from place to place, they are never twice. In a regression, which is soon done, inputs that
    turn, if refused, are asked for once more (`_actuation_anew`). Where M and V are given a regression is linear in g
    and, but for knees, in friction: of inputs that turn and of directions its answer stands (`answered`). On six joints
    rollouts take minutes to ask again.

    The same goes for a V that is no polynomial of lengths, or has more than an angle's first harmonics: the network of
    lengths, and the series of single angles, are asked for early. On angles networks come last, since harmonics hold
    what rigid bodies have, and cogging; a series that was refused stays closed then.

    A V that was set free takes up what friction does, and leaves none to be found: the laws are asked for once more in
    the place of its correction, and stay if validation gains at all, since they are fewer numbers and only take energy.

    If V's was refused, it is asked for once more together with friction's laws: of a drive with cogging and dry
    friction, either alone bends to take up what the other leaves.

    Errors are not whitened where anything is set free: what a block has not learned yet is no noise, and must count in
    full.

    More than `MOST_PARAMETERS` are too many: harmonics of g then stay closed.

    Returns:
        The stages.
    """

    def has(kind: int) -> bool:
        return config.growth_steps > 0 and _has(dynamics, kind)

    judged = _laws(dynamics, config)
    fits = functools.partial(_fits, dynamics)
    rubs = judged > 0
    turns = has(ACTUATION) and not answered and fits(judged | DIRECTIONS | ACTUATION)
    bends = has(POTENTIAL) and fits(judged | DIRECTIONS | POTENTIAL)
    of = "regression: " if regression else ""
    further = functools.partial(
        LevenbergStage, data=data, config=config, steps=config.growth_steps, frees=True, margin=CLEAR
    )
    # A network keeps what windows have taught it that are left out.
    bent = further if any(dynamics.space.is_angle) else functools.partial(further, data=data._replace(in_turn=False))
    judged_by = data.validation is not None  # Without, whatever is no gain in training would be kept.
    instead = rubs and bends and judged_by
    asked = (
        (has(INERTIA) and fits(judged | DIRECTIONS | INERTIA), further(name=of + "inertia", corrections=INERTIA)),
        (turns, further(name=of + "actuation", corrections=ACTUATION)),
        (bends, bent(name=of + "potential", corrections=POTENTIAL)),
        (rubs, further(name=of + "friction", corrections=FRICTION, margin=CHANCE)),
        (instead, further(name=of + "friction instead", corrections=FRICTION, begins=Without(POTENTIAL), margin=0.0)),
        (
            rubs and bends,
            bent(name=of + "potential and friction", corrections=POTENTIAL | FRICTION, unless=POTENTIAL),
        ),
        (rubs and has(DIRECTIONS) and not answered, further(name=of + "directions", corrections=FRICTION | DIRECTIONS)),
    )
    stages = [stage for sensible, stage in asked if sensible]
    return [*stages, *_closings(dynamics, data, config, of)] if judged_by else stages


def _closings(dynamics: AbstractDynamics, data: Data, config: TrainingConfig, of: str) -> list[LevenbergStage]:
    """What can be done without: V as of a motor, and an M that depends on the configuration, as of a pendulum's wheel.

    V takes up what friction does on the recordings that there are, M what inputs do, and recordings elsewhere are
    predicted up to thirty times worse (`benchmarks/`). It is asked last, when what either may have stood for is there;
    where it was found that V has more to it, or M, there is no such question. A regression finds a constant M where
    rollouts, from one that is bent, do not; these have the last word, with all of it open.

    Returns:
        The stages.
    """
    if not config.growth_steps:
        return []
    few = data.hardly_validated and not data.in_turn  # These must say that it is better.
    stage = functools.partial(LevenbergStage, data, config, steps=config.growth_steps, margin=0.0 if few else -CHANCE)
    asked = (
        ("no potential", Uniform("potential"), POTENTIAL),
        ("constant inertia", Uniform("inverse_mass"), INERTIA),
    )
    return [stage(of + name, begins=begin, unless=kind) for name, begin, kind in asked if begin.has(dynamics)]


def _laws(dynamics: AbstractDynamics, config: TrainingConfig) -> int:
    """Friction's laws where they are asked for, as flags."""
    return FRICTION if config.growth_steps > 0 and _has(dynamics, FRICTION) else 0


def _growth(
    dataset: Dataset, dynamics: AbstractDynamics, data: Data, config: TrainingConfig, *, after: int
) -> list[LevenbergStage]:
    """Networks, last.

    They learn from half of the recordings what the others must confirm, if that can be asked of them, and are fitted to
    all of them then. What they must improve on is fitted to the same half before: the best model so far has
    learned from the others too, and to forget these is no fault of networks. Where that is lost on the others, half of
    the recordings cannot tell of networks either. In the end all of it must be no worse than what was before.

    More than `MOST_PARAMETERS` are too many: they stay closed.

    Args:
        dataset: Recordings, with their validation part.
        dynamics: Untrained model.
        data: Windows of all recordings.
        config: Settings.
        after: How many stages come before.

    Returns:
        The stages.
    """
    kinds = FRICTION if _has(dynamics, FRICTION) else 0
    networks = NETWORKS if any(dynamics.space.is_angle) else NETWORKS | POTENTIAL
    if not (config.growth_steps and _has(dynamics, networks) and _fits(dynamics, kinds | networks)):
        return []
    steps = config.growth_steps
    apart = across_recordings(dataset, dynamics, data, config)
    if apart is None:
        return [LevenbergStage(data, config, "growth", steps, kinds | networks, margin=CLEAR, frees=True)]
    rivalled = _fits(dynamics, kinds)  # Else every part is given, and has learned nothing.
    stage = functools.partial(LevenbergStage, config=config, steps=steps)
    rival = [stage(apart, name="refit on half", corrections=kinds, margin=0.0, rivals=True)] if rivalled else []
    growth = stage(
        apart,
        name="growth",
        corrections=kinds | networks,
        margin=CLEAR,
        frees=True,
        begins=Refitted() if rivalled else Best(),
    )
    after += len(rival)
    on_all = stage(data, name="growth on all", corrections=kinds, margin=-CHANCE, begins=Joined(), after=after)
    return [*rival, growth, on_all]


def _has(dynamics: AbstractDynamics, kind: int) -> bool:
    """Whether there are corrections of a kind."""
    return count_parameters(dynamics, corrections=kind) > count_parameters(dynamics, corrections=0)


def _fits(dynamics: AbstractDynamics, kinds: int) -> bool:
    """Whether something is free with corrections of these kinds, and not too much of it."""
    return 0 < count_parameters(dynamics, corrections=kinds) <= MOST_PARAMETERS


def _actuation_anew(dynamics: AbstractDynamics, data: Data, config: TrainingConfig, *, learns: bool) -> LevenbergStage:
    """Inputs that turn, by another regression from the untrained model on, after priors are learned in both."""
    # M and V may be bent around a constant g so far that there is no way back.
    return LevenbergStage(
        data,
        config,
        "regression: actuation anew",
        config.lm_steps + (config.relevance_steps if learns else 0),
        ACTUATION,
        margin=CLEAR,
        learns=learns,
        frees=True,
        begins=Untrained(dynamics),
        plain=config.lm_steps,
    )
