"""How to read tables and figures, in words that hold whatever the numbers are."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

READ_ERRORS: Final = (
    "An error is the sum, over the samples and observation channels of a trajectory, of the squared error of one "
    "rollout from its first sample; the table has its mean ± standard deviation over trajectories. *Train* and "
    "*test* are over trajectories of 20 samples under constant inputs, *prediction* over trajectories of 40 samples "
    "without input. The ratio is the paper's mean relative to ours. Over several seeds ours is the seed with the "
    "median mean (the lower one of an even number), with the range of the means."
)

READ_DOTS: Final = "Dots are medians over seeds, bars their range, diamonds the paper's published numbers."

READ_BLOCKS: Final = (
    "Learned M⁻¹, V, g and D against those of the simulated system, at the states that the training data visited: "
    "for matrices the Frobenius norm of the difference relative to that of the truth, for V the largest difference "
    "up to a constant relative to its range. The scale that the data cannot tell, β, is found from g alone and taken"
    " out. Each number is the worst over these states, and for D also the median over them; of several seeds the "
    "median, and in parentheses the worst."
)

READ_SWEEPS: Final = (
    "Prediction errors, on data free of noise, of models that were trained on fewer or more trajectories, or on "
    "noisy ones: Gaussian noise of this standard deviation on every coordinate and rate, in their own units. Of "
    "several seeds the median, and in parentheses the range."
)

# Kind of figure: its heading, and how to read it.
KINDS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "blocks": (
            "What was learned",
            "Circles are the truth, lines the dissipative model; a matrix has a line for each of its entries, "
            "numbered by row and column. The other coordinates are in the middle of the data. Where curves go beyond"
            " the training data, dotted lines mark the range of these; the error in a title is over this range.",
        ),
        "phase": (
            "Vector fields and trajectories",
            "Grey streamlines are the vector field without input, of the true system and of each model. Circles are "
            "true trajectories from initial states that no model has seen, lines the models' rollouts from them. The"
            " field error is the root mean square of the difference from the true field over this plane, relative to"
            " that of the true field.",
        ),
        "energy": (
            "Energy along rollouts",
            "The energy of the true system, evaluated along the true trajectory (circles) and along each model's "
            "rollout (lines), without input. A line that rises is a rollout that gains energy from nowhere; one that"
            " leaves the panel has gained or lost more than there is room for.",
        ),
        "circle": (
            "Angles on their circles",
            "How far a model's cosine and sine of an angle leave the circle cos² + sin² = 1, worst over angles and "
            "trajectories. About 10⁻¹⁶ is the rounding of the numbers themselves.",
        ),
        "extrapolation": (
            "Where the error comes from when an angle is taken for a number",
            "Left: each point is one trajectory of the prediction error, over how far its true motion goes beyond "
            "the training data; the title says which share of the summed error those beyond it have. Right: the "
            "squared error of every sample of these rollouts over the true coordinate, and how many training samples"
            " there are.",
        ),
        "sweep": (
            "Fewer trajectories, and noise",
            "Prediction error over the number of training trajectories without noise (dotted line: as in the paper),"
            " and over the noise on the training data with as many trajectories as in the paper. Bars are the range "
            "over seeds; a cross at the upper edge: training failed, or the error is not finite.",
        ),
    }
)
