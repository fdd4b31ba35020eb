from symoden import (
    blocks as blocks,
    control as control,
    data as data,
    drawing as drawing,
    envs as envs,
    evaluation as evaluation,
    experiments as experiments,
    integrate as integrate,
    known as known,
    mechanics as mechanics,
    models as models,
    report as report,
    shapes as shapes,
    spaces as spaces,
    storage as storage,
    systems as systems,
    testing as testing,
    training as training,
    units as units,
    wording as wording,
)
from symoden.control import design as design, run_episodes as run_episodes
from symoden.data import (
    Dataset as Dataset,
    Trajectory as Trajectory,
    check_dataset as check_dataset,
    read_dataset as read_dataset,
    write_dataset as write_dataset,
)
from symoden.evaluation import infer_bands as infer_bands, predict as predict, write_urdf as write_urdf
from symoden.integrate import rollout as rollout
from symoden.known import KnownParts as KnownParts, read_urdf as read_urdf
from symoden.models import ModelConfig as ModelConfig, build as build, load as load, rescale as rescale, save as save
from symoden.spaces import Space as Space
from symoden.systems import Acrobot as Acrobot, CartPole as CartPole, Pendulum as Pendulum
from symoden.training import TrainingConfig as TrainingConfig, fit as fit

__version__: str
_EXPORTS: dict[str, str]
_PACKAGES: tuple[str, ...]
