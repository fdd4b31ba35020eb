"""Inputs that push the other way round than the given g says are named, others are not."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset

STEP = 0.01
INERTIA = np.array([[1.0, 0.3], [0.3, 0.5]])


def cart(path, g, *, seed=0, samples=2000, noise=1e-3, late=0, friction=0.5):
    """Two coupled joints, one under gravity, with steps of their inputs."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-2, 2, (samples // 40 + 1, 2)), 40, axis=0)[:samples]
    acts = np.concatenate([np.zeros((late, 2)), u])[:samples]
    states = np.zeros((samples, 4))
    inverse = np.linalg.inv(INERTIA)
    for k in range(samples - 1):
        q, v = np.split(states[k], 2)
        for _ in range(10):
            force = g @ acts[k] - [0.0, 3 * np.sin(q[1])] - friction * v - 2 * q * [1, 0]
            v = v + STEP / 10 * inverse @ force
            q = q + STEP / 10 * v
        states[k + 1] = np.concatenate([q, v])
    measured = states + rng.normal(0, noise, states.shape) * [1, 1, 3, 3]
    rows = np.column_stack([STEP * np.arange(samples), measured, u])
    np.savetxt(path / "run.csv", rows, delimiter=",", header="t,x,q,vx,vq,u,w", comments="")


def described(path, matrix, more="", kind="sign"):
    """A description with such a g, and what is said of signs."""
    file = path / "run.toml"
    given = f"input_matrix = {np.asarray(matrix).tolist()}" if matrix is not None else ""
    file.write_text(
        f'space = "R1 T1"\ntime = "t"\npositions = ["x", "q"]\nvelocities = ["vx", "vq"]\ninputs = ["u", "w"]\n'
        f'{given}\n{more}\n[train]\nfiles = ["run.csv"]\n'
    )
    return file, [one for one in check_dataset(file).findings if one.kind == kind]


@pytest.mark.parametrize("noise", [1e-3, 3e-3])
@pytest.mark.parametrize(
    ("signs", "named"), [((1, 1), ()), ((-1, 1), ("u",)), ((1, -1), ("w",)), ((-1, -1), ("u", "w"))]
)
def test_an_input_of_the_wrong_sign_is_named(tmp_path, signs, named, noise):
    g = np.array([[2.0, 0.5], [0.0, 1.0]])
    cart(tmp_path, g, noise=noise)
    file, found = described(tmp_path, g * signs)
    assert len(found) == bool(named)
    for one in found:
        assert (one.level, one.channel) == ("warning", named[0] if len(named) == 1 else "")
        assert all(f"{name} = -1" in one.advice for name in named)
        with pytest.warns(DataWarning, match="the other way round than `input_matrix` says"):
            read_dataset(file)
        turned = ", ".join(f"{name} = -1" for name in named)
        assert described(tmp_path, g * signs, f"units = {{{turned}}}")[1] == []


@pytest.mark.parametrize(
    ("matrix", "named"),
    [
        ([["-1", "0"], ["0", "k"]], ["u"]),
        ([["-a", "0"], ["0", "-k"]], ["", "u", "w"]),
        ([["a", "0"], ["0", "-k"]], ["w"]),
        ([["a", "0"], ["0", "k"]], []),
        ([["a", "0"], ["0", "-free"]], []),
        ([["-cos(q2)*a", "0"], ["0", "k"]], []),
        ([["-a", "0"], ["k", "1"]], []),
    ],
)
def test_signs_are_told_of_inputs_that_are_known_up_to_a_factor(tmp_path, matrix, named):
    cart(tmp_path, np.diag([2.0, 0.7]))
    used = {name: start for name, start in (("a", 1.5), ("k", 1.0), ("free", 0.0)) if name in str(matrix)}
    parts = f"[known]\ninput_matrix = {matrix}\n[known.parameters]\n"
    parts += "\n".join(f"{name} = {start}" for name, start in used.items())
    _, found = described(tmp_path, None, parts)
    assert [one.channel for one in found] == named[:1]
    assert all(f"{name} = -1" in one.advice for one in found for name in named if name)


def test_the_sign_is_advised_by_the_name_that_the_file_has(tmp_path):
    g = np.eye(2)
    cart(tmp_path, g)
    table = tmp_path / "run.csv"
    table.write_text(table.read_text().replace("u,w", "u [mA],w [A]"))
    file = tmp_path / "run.toml"
    text = (
        'space = "R1 T1"\ntime = "t"\npositions = ["x", "q"]\nvelocities = ["vx", "vq"]\ninputs = ["u [mA]", "w [A]"]\n'
        'units = {{ "w [A]" = {factor} }}\ninput_matrix = {g}\n[train]\nfiles = ["run.csv"]\n'
    )
    file.write_text(text.format(factor=-1, g=g.tolist()))
    (one,) = [one for one in check_dataset(file).findings if one.kind == "sign"]
    assert (one.channel, '"w [A]" = 1' in one.advice) == ("w [A]", True)
    file.write_text(text.format(factor=1, g=g.tolist()))
    assert [one for one in check_dataset(file).findings if one.kind == "sign"] == []


@pytest.mark.parametrize("g", [np.eye(2), np.array([[2.0, 0.5], [0.0, 1.0]])])
@pytest.mark.parametrize("seed", range(2))
def test_inputs_that_are_exchanged_are_named(tmp_path, g, seed):
    cart(tmp_path, g, seed=seed)
    assert described(tmp_path, g, kind="order")[1] == []
    file, (one,) = described(tmp_path, g[:, ::-1], kind="order")
    assert (one.level, one.channel) == ("warning", "u")
    assert "`u` accelerates the mechanism as `input_matrix` says of `w`" in one.text
    assert described(tmp_path, g[:, ::-1])[1] == []
    with pytest.warns(DataWarning, match="Exchange them in `inputs`"):
        read_dataset(file)


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_said_of_right_signs_hardly_any_motion_or_an_unknown_g(tmp_path, seed):
    g = np.eye(2)
    cart(tmp_path, g, seed=seed, noise=0.05)
    assert described(tmp_path, g)[1] == []
    assert described(tmp_path, None)[1] == []
    cart(tmp_path, -g, seed=seed, samples=60)
    assert described(tmp_path, g)[1] == []
    cart(tmp_path, -1e-6 * g, seed=seed)
    assert described(tmp_path, g)[1] == []


@pytest.mark.parametrize("late", [10, 20])
def test_an_input_that_is_late_is_not_taken_for_one_of_the_wrong_sign(tmp_path, late):
    cart(tmp_path, np.eye(2), late=late)
    assert described(tmp_path, np.eye(2))[1] == []
