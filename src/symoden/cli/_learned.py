"""What is known of a run's model, as tables and sentences; shared by `inspect` and `report`."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from symoden.data import Dataset, Trajectory
from symoden.experiments import (
    Audit,
    Bands,
    BandScore,
    Certainty,
    Inspection,
    Profile,
    RunConfig,
    Source,
    audit,
    calibrate_bands,
    certainty,
    evaluation_solver,
    inspect_model,
    read_model,
    read_posterior,
    read_run,
    read_run_source,
    recorded_paths,
)
from symoden.mechanics import AbstractDynamics
from symoden.models import StructuredModel
from symoden.spaces import Space
from symoden.training import AbstractPosterior, hold_out

from ._output import TableText, number
from ._progress import show_work

ROWS = 5  # Of a table.
MOST_DRAWN = 8  # Recordings in one figure.
_FINE = 61  # Points of a line.
_NONE = 1e-6  # Relative width of a band that is none.


@dataclass(frozen=True, kw_only=True, eq=False)
class Learned:
    """A run's model and what can be said of it.

    Attributes:
        config: Settings of the run.
        model: Its model.
        source: Its data; None where they cannot be read any more.
        missing: Why not.
        posterior: What the data say of the model's parameters, where that is known.
        uncertain: Why there are no bands on M, V, g and D.
    """

    config: RunConfig
    model: AbstractDynamics
    source: Source | None
    missing: str
    posterior: AbstractPosterior | None
    uncertain: str

    @classmethod
    def of(cls, run: Path) -> "Learned":
        """Read a run.

        Args:
            run: Its folder.

        Returns:
            What is known.
        """
        config, model = read_run(run), read_model(run)
        source, posterior, missing = None, None, ""
        try:
            source = read_run_source(config)
        except ValueError as error:
            missing = " ".join(str(error).split())
        uncertain = f"the run's data cannot be read: {missing}"
        if source is not None:
            uncertain = "" if isinstance(model, StructuredModel) else "this kind of model has no M, V, g and D"
            try:
                posterior = posterior_of(run, model, config, source.dataset)
            except ValueError as error:
                uncertain = uncertain or str(error)
        return cls(config=config, model=model, source=source, missing=missing, posterior=posterior, uncertain=uncertain)

    def inspect(self, points: int = ROWS) -> tuple[Inspection, Certainty | None]:
        """Evaluate the blocks over the data's range, with bands where these are known.

        Args:
            points: Number of values along each coordinate and velocity.

        Returns:
            Both.
        """
        ranges = self.config.data.ranges
        found = (
            inspect_model(self.model, ranges) if points is None else inspect_model(self.model, ranges, points=points)
        )
        if self.posterior is None or found.velocities is None:
            return found, None
        with show_work("bands of M, V, g and D"):
            return found, certainty(self.posterior, found)

    def bands(self) -> Bands | None:
        """What makes bands of rollouts, where that is known."""
        if self.posterior is None or self.source is None:
            return None
        return bands_of(self.posterior, self.config, self.source.dataset)

    def draw(self) -> Any:  # noqa: ANN401 - only `report` knows matplotlib
        """Figure of the blocks over the data's range.

        Returns:
            The figure.

        Raises:
            ValueError: If the model has none.
        """
        from symoden.report import draw_inspection

        data = self.config.data
        return draw_inspection(*self.inspect(_FINE), positions=data.position_names, inputs=data.input_names)

    def audit(self) -> tuple[str, Audit | None]:
        """Check the balance of powers on recordings that were not trained on.

        Returns:
            The part that they are of, and the audit; None without data.
        """
        if self.source is None:
            return "", None
        split, recordings = unseen(self.source.dataset)
        data = self.config.data
        solver = evaluation_solver(self.config)
        with show_work(f"power audit on the {split} recordings"):
            return split, audit(self.model, recordings, ranges=data.ranges, hold=data.hold, solver=solver)


def unseen(dataset: Dataset) -> tuple[str, tuple[Trajectory, ...]]:
    """The test recordings, or those of training where there are no others.

    Args:
        dataset: Data.

    Returns:
        The name of the part, and its recordings.
    """
    return ("test", dataset.test) if dataset.test else ("train", dataset.train)


def posterior_of(run: Path, model: AbstractDynamics, config: RunConfig, dataset: Dataset) -> AbstractPosterior:
    """What the data leave open about a run's model (`read_posterior`), with a word on it, for it may take a minute.

    Args:
        run: Folder of the run.
        model: Its model.
        config: Its settings.
        dataset: Its data.

    Returns:
        The posterior.
    """
    with show_work("how certain the parameters are"):
        return read_posterior(run, model, config, dataset)


def bands_of(posterior: AbstractPosterior, config: RunConfig, dataset: Dataset) -> Bands:
    """Bands of a run's rollouts, as wide as the recordings that its training held out ask for.

    Args:
        posterior: What the data say of the model's parameters.
        config: Settings of the run.
        dataset: Its data.

    Returns:
        The bands.
    """
    with show_work("bands of predictions"):
        return calibrate_bands(posterior, hold_out(dataset, config.training), solver=evaluation_solver(config))


def draw_unseen(model: AbstractDynamics, config: RunConfig, dataset: Dataset, bands: Bands | None) -> Any:  # noqa: ANN401
    """Figure of the first recordings that were not trained on, with rollouts along them.

    Args:
        model: The run's model.
        config: Settings of the run.
        dataset: Recordings.
        bands: Bands, if they are to be drawn.

    Returns:
        The figure.
    """
    from symoden.report import draw_recorded

    chosen = unseen(dataset)[1][:MOST_DRAWN]
    paths = recorded_paths(model, chosen, hold=dataset.hold, solver=evaluation_solver(config), bands=bands)
    space = Space.parse(config.data.space)
    return draw_recorded(paths, [space.title(name, i) for i, name in enumerate(config.data.position_names)])


def facts(found: Inspection) -> Iterator[tuple[str, str]]:
    """What a model is, in a line each.

    Args:
        found: What was found.

    Yields:
        Name and value.
    """
    yield "parameters", str(found.parameters)
    yield "what fixes the scale", found.anchor
    yield from found.given.items()
    for name, extremes in (("M", found.mass_matrix_eigenvalues), ("D", found.dissipation_eigenvalues)):
        none = "does not apply: this kind of model has none"
        yield (
            f"eigenvalues of {name} over the data's range",
            none if extremes is None else "{} to {}".format(*map(number, extremes)),
        )


def tables(found: Inspection, certain: Certainty | None, config: RunConfig) -> Iterator[TableText]:
    """Everything that was found, each number with half of the width of its band.

    Args:
        found: What was found.
        certain: Its bands.
        config: Settings of the run.

    Yields:
        The tables.
    """
    if found.identified:
        rows = [(name, banded(value, certain and certain.identified[name])) for name, value in found.identified.items()]
        yield TableText("identified parameters", ("name", "value"), rows)
    names, space = (config.data.position_names, config.data.input_names), Space.parse(found.space)
    for i, profile in enumerate(found.profiles):
        half = certain and certain.profiles[i]
        yield from _profile_tables(profile, half, *names, title=space.title(names[0][i], i), given=found.given)
    for k, along in enumerate(found.friction):
        i, band = along.coordinate, certain and certain.friction[k]
        columns = (along.coefficient, band and band.coefficient), (along.force, band and band.force)
        rows = [
            (number(v), *(banded(values[j], None if half is None else half[j]) for values, half in columns))
            for j, v in enumerate(along.velocities)
        ]
        title = f"friction along the velocity of {names[0][i]}, the data's middle otherwise"
        yield TableText(title, (space.title("v", i, rate=True), f"D[{i + 1}, {i + 1}]", "force D v"), rows)


def certainty_words(certain: Certainty | None, missing: str) -> Iterator[str]:
    """How certain all this is, in words.

    Args:
        certain: The bands.
        missing: Why there are none.

    Yields:
        Lines.
    """
    if certain is None:
        yield f"no bands: {missing}"
        return
    if certain.members is None:
        yield (
            f"± is half of a {certain.level:.0%} band, to first order; {certain.windows} windows determine "
            f"{certain.effective:.0f} of {certain.parameters} free parameters"
        )
    else:
        models = ensemble_words(certain.members, certain.tried or 0)
        yield (
            f"± is half of a {certain.level:.0%} band, from {models}, each trained on {certain.windows} windows drawn "
            "with replacement"
        )
    yield "typical: " + ", ".join(f"{name} ± {value:.1%}" for name, value in certain.relative.items() if value > _NONE)
    if certain.undetermined:
        yield f"no larger than their bands, so not told by these data: {', '.join(certain.undetermined)}"


def ensemble_words(members: int, tried: int) -> str:
    """How many models there are of an ensemble.

    Args:
        members: Number of models.
        tried: Number of models that were trained.

    Returns:
        The words.
    """
    astray = f" ({tried - members} more fitted worse than the model)" if tried > members else ""
    return f"{members} models from other initial weights{astray}"


def band_words(score: BandScore) -> str:
    """How well bands cover, in a sentence.

    Args:
        score: The score.

    Returns:
        The sentence.
    """
    return (
        f"{score.level:.0%} bands over windows of 1 s cover {score.coverage:.1%} of the positions of the {score.split} "
        f"recordings; median half width {number(score.half_width)}, {score.from_parameters:.0%} of the variance from "
        f"uncertain parameters; width set by the {score.calibrated_on} recordings"
    )


def audit_words(split: str, result: Audit | None, missing: str) -> Iterator[str]:
    """The power audit in words.

    Args:
        split: Part that was looked at.
        result: The audit.
        missing: Why there is none.

    Yields:
        Lines.
    """
    if result is None:
        yield f"not made, because the run's data cannot be read: {missing}"
        return
    several = "" if result.recordings == 1 else "s"
    yield f"{result.recordings} {split} recording{several}; outside the range of training: {result.outside:.1%}"
    if result.diverged is None:
        yield "the balance of powers does not apply: this kind of model has no energy"
        return
    yield f"rollouts: {result.rollouts}, of which {result.diverged} diverged"
    yield f"largest violation of dH/dt = y'u - v'Dv along rollouts, relative: {number(result.rollout_violation)}"
    yield (
        "residual of the energy balance along recordings, relative: "
        f"median {number(result.log_residual_median)}, largest {number(result.log_residual_max)}"
    )
    yield f"least eigenvalue of inv(M): {number(result.inverse_mass_min)}, of D: {number(result.dissipation_min)}"


def audit_as_json(split: str, result: Audit | None, missing: str) -> dict[str, object]:
    """The same for a program.

    Args:
        split: Part that was looked at.
        result: The audit.
        missing: Why there is none.

    Returns:
        What JSON has.
    """
    return {"unavailable": missing} if result is None else {"split": split, **asdict(result)}


def banded(value: float, half_width: float | None) -> str:
    """A number, and half of the width of its band.

    Args:
        value: The number.
        half_width: Half of its band.

    Returns:
        The text.
    """
    return number(value) if half_width is None else f"{number(value)} ± {half_width:.2g}"


def _profile_tables(
    profile: Profile,
    widths: Profile | None,
    positions: Sequence[str],
    inputs: Sequence[str],
    *,
    title: str,
    given: Collection[str],
) -> Iterator[TableText]:
    """Blocks along one coordinate: the energy's in one table, what acts in another."""
    name = positions[profile.coordinate]
    others = ", the other coordinates in the middle of the data" if len(positions) > 1 else ""
    at = "; D at half of the largest velocities" if profile.dissipation_matrix is not None else ""
    names = positions, inputs, given
    for curves, half, note in (
        (profile.energy_curves(), widths and widths.energy_curves(), ""),
        (profile.port_curves(*names), widths and widths.port_curves(*names), at),
    ):
        if curves:
            rows = [
                [number(value), *(banded(curves[head][k], None if half is None else half[head][k]) for head in curves)]
                for k, value in enumerate(profile.values)
            ]
            yield TableText(f"along {name}{others}{note}", (title, *curves), rows)
