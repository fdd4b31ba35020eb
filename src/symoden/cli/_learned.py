"""What is known of a run's model; shared by `inspect`, `report` and `evaluate`."""

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from symoden.data import Dataset, Trajectory
from symoden.evaluation import (
    Audit,
    Bands,
    Certainty,
    Inspection,
    audit,
    calibrate_bands,
    certainty,
    inspect_model,
    recorded_paths,
)
from symoden.experiments import (
    RunConfig,
    Source,
    evaluation_solver,
    read_model,
    read_posterior,
    read_run,
    read_run_source,
)
from symoden.mechanics import AbstractDynamics
from symoden.models import StructuredModel
from symoden.training import AbstractPosterior, hold_out
from symoden.units import titled

from ._disturbed import Disturbed
from ._progress import show_work
from ._warnings import said_before

ROWS = 5  # Of a table.
MOST_DRAWN = 8  # Recordings in one figure.
_FINE = 61  # Points of a line.


@dataclass(frozen=True, kw_only=True, eq=False)
class Learned:
    """A run's model and what can be said of it.

    Attributes:
        config: Settings of the run.
        model: Its model.
        source: Its data; None where they cannot be read any more.
        missing: Why not.
        posterior: What the data say of the parameters of a model with M, V, g and D, where that is known.
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
            source = own_source(config)
        except ValueError as error:
            missing = " ".join(str(error).split())
        uncertain = f"the run's data cannot be read: {missing}"
        if source is not None and not isinstance(model, StructuredModel):
            uncertain = "this kind of model has no M, V, g and D of its own"
        elif source is not None:
            try:
                posterior, uncertain = posterior_of(run, model, config, source.dataset), ""
            except ValueError as error:
                uncertain = str(error)
        return cls(config=config, model=model, source=source, missing=missing, posterior=posterior, uncertain=uncertain)

    def inspect(self, points: int = ROWS) -> tuple[Inspection, Certainty | None]:
        """Evaluate the blocks over the data's range, with bands where these are known.

        Args:
            points: Number of values along each coordinate, and each velocity in either direction.

        Returns:
            Both.
        """
        data = self.config.data
        found = inspect_model(self.model, data.ranges, position_units=data.position_units, points=points)
        if self.posterior is None:
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


def own_source(config: RunConfig) -> Source:
    """Read the data that a run was trained on; what is odd about them was said then, but not if they have changed.

    Args:
        config: Settings of the run.

    Returns:
        The data.
    """
    with said_before():
        source = read_run_source(config)
    if words := changed_words(config, source):
        print(f"warning: {words}", file=sys.stderr)
    return source


def changed_words(config: RunConfig, source: Source) -> str:
    """What to say where a run's data have changed.

    Args:
        config: Settings of the run.
        source: Its data.

    Returns:
        The words; none where they are as they were.
    """
    if source.task is not None or source.dataset.digest == config.data.digest:
        return ""
    return (
        f"`{source.name}`: the data are no longer those that the run was trained on. Restore them, or train anew: its "
        "bands are those of other data."
    )


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


def name_untold_inputs(run: Path, model: AbstractDynamics, config: RunConfig, posterior: AbstractPosterior) -> None:
    """Say on standard error which inputs do nothing that these data tell from nothing.

    Predictions may be good all the same where feedback made the inputs; a controller from such a model is not.

    Args:
        run: Folder of the run.
        model: Its model.
        config: Its settings.
        posterior: What the data say of the model's parameters.
    """
    if not isinstance(model, StructuredModel):
        return
    found = inspect_model(model, config.data.ranges, points=ROWS)
    if not config.data.input_names or "input_matrix" in found.given:
        return
    with show_work("what inputs do"):
        certain = certainty(posterior, found)
    if certain.accelerations.get("inputs", math.inf) < 1:
        return  # What they accelerate is told: g alone is as open as the scale of each coordinate is.
    rows = range(1, len(config.data.position_names) + 1)
    names = [
        f"`{name}`"
        for j, name in enumerate(config.data.input_names, start=1)
        if all(f"g[{i}, {j}]" in certain.undetermined for i in rows)
    ]
    if names:
        do = "does" if len(names) == 1 else "do"
        print(
            f"warning: what {', '.join(names)} {do} is not told by these data: g is nowhere larger than its band, but "
            f"controllers need it. `symoden data check` and `symoden inspect {run}` say why.",
            file=sys.stderr,
        )


def draw_unseen(
    model: AbstractDynamics, config: RunConfig, dataset: Dataset, bands: Bands | None, disturbed: Disturbed
) -> Any:  # noqa: ANN401 - only `report` knows matplotlib
    """Figure of the first recordings that were not trained on, with rollouts along them.

    Args:
        model: The run's model.
        config: Settings of the run.
        dataset: Recordings.
        bands: Bands, if they are to be drawn.
        disturbed: Spans of test recordings that are marked; of training recordings those are that were left out.

    Returns:
        The figure.
    """
    from symoden.report import draw_recorded

    split, recordings = unseen(dataset)
    if split == "train":
        disturbed = (config.training.left_out or ()) if dataset.digest == config.data.digest else ()
    chosen = recordings[:MOST_DRAWN]
    paths = recorded_paths(model, chosen, hold=dataset.hold, solver=evaluation_solver(config), bands=bands)
    spans = [[(start, end) for name, start, end in disturbed if name == each.name] for each in chosen]
    return draw_recorded(paths, list(map(titled, config.data.position_names, dataset.position_units)), spans)
