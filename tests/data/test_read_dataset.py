"""From a description to recordings: angles unwrapped, rates completed, resampled, split; parts apart."""

from pathlib import Path

import numpy as np
import pytest

from symoden.data import DataError, DataWarning, read_dataset

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
HEAD = 'space = "R1 T1"\ntime = "t"\npositions = ["x", "phi"]\nvelocities = ["vx", "vphi"]\ninputs = ["u"]\n'
TRAIN = '[train]\nfiles = ["a.csv"]\n'


def write_run(path, *, seed=0, samples=100, wrapped=True):
    t = 0.01 * np.arange(samples)
    x, phi = 20 * np.sin(t + seed), 15 * t + seed
    shown = np.mod(phi, 2 * np.pi) if wrapped else phi
    columns = np.stack([t, x, shown, 20 * np.cos(t + seed), np.full(samples, 15.0), np.sign(np.sin(9 * t))], axis=1)
    np.savetxt(path, columns, delimiter=",", header="t,x,phi,vx,vphi,u", comments="", fmt="%.17g")
    return t, x, phi


def described(tmp_path, text):
    path = tmp_path / "arm.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_everything_arrives_where_it_belongs(tmp_path):
    t, x, phi = write_run(tmp_path / "a.csv")
    write_run(tmp_path / "b.csv", seed=1)
    write_run(tmp_path / "c.csv", seed=2)
    text = "hold = 'linear'\ninput_matrix = [[1], [0]]\ninitial_samples = 2\n" + HEAD + TRAIN
    text += '[test]\nfiles = ["b.csv"]\n[validation]\nfiles = ["c.csv"]\n'
    dataset = read_dataset(described(tmp_path, text))
    assert [[r.name for r in part] for part in (dataset.train, dataset.test, dataset.validation)] == [
        ["a"],
        ["b"],
        ["c"],
    ]
    assert (dataset.name, dataset.space, dataset.momenta, dataset.hold) == ("arm", "R1 T1", False, "linear")
    assert (dataset.position_names, dataset.input_names) == (("x", "phi"), ("u",))
    np.testing.assert_array_equal(dataset.input_matrix, [[1.0], [0.0]])
    run = dataset.train[0]
    assert run.initial_samples == 2
    np.testing.assert_array_equal(run.ts, t)
    np.testing.assert_array_equal(run.q[:, 0], x)  # a length may jump by more than π
    np.testing.assert_allclose(run.q[:, 1], phi, atol=1e-12)
    np.testing.assert_array_equal(run.rates[:, 1], 15.0)
    np.testing.assert_array_equal(run.us[:, 0], np.sign(np.sin(9 * t)))


def test_an_angle_taken_for_a_number_keeps_its_jumps(tmp_path):
    write_run(tmp_path / "a.csv")
    with pytest.warns(DataWarning, match=r"`phi` jumps by 2π \d+ times, .* but the description calls it a length"):
        run = read_dataset(described(tmp_path, HEAD + TRAIN), space="R2").train[0]
    assert np.abs(np.diff(run.q[:, 1])).max() > 6


def test_momenta_free_motion_and_a_fixed_step(tmp_path):
    q = np.random.default_rng(0).normal(size=(9, 2))
    np.savez(tmp_path / "a.npz", q=q, p=2 * q)
    text = 'space = "R2"\ndt = 0.5\npositions = "q"\nmomenta = "p"\n[train]\nfiles = ["a.npz"]\n'
    dataset = read_dataset(described(tmp_path, text))
    assert dataset.momenta
    assert dataset.inputs == 0
    np.testing.assert_array_equal(dataset.train[0].ts, 0.5 * np.arange(9))
    np.testing.assert_array_equal(dataset.train[0].rates, 2 * q)
    assert dataset.position_names == ("q[0]", "q[1]")


def test_absent_velocities_are_estimated_from_unwrapped_angles(tmp_path):
    write_run(tmp_path / "a.csv")
    run = read_dataset(described(tmp_path, HEAD.replace('velocities = ["vx", "vphi"]\n', "") + TRAIN)).train[0]
    np.testing.assert_allclose(run.rates[:, 1], 15.0, atol=1e-9)
    np.testing.assert_allclose(run.rates[:, 0], 20 * np.cos(run.ts), atol=1e-3)


def test_rows_come_first_then_resampling_then_splitting(tmp_path):
    write_run(tmp_path / "a.csv", samples=400)
    dataset = read_dataset(described(tmp_path, f"resample = 0.02\n{HEAD}{TRAIN}rows = [100, 300]\nsplit_every = 0.5\n"))
    assert [(r.name, len(r)) for r in dataset.train] == [("a#1", 25), ("a#2", 25), ("a#3", 25), ("a#4", 25)]
    ts = np.concatenate([r.ts for r in dataset.train])
    np.testing.assert_allclose(ts, 1.0 + 0.02 * np.arange(100))
    phi = np.concatenate([r.q[:, 1] for r in dataset.train])
    np.testing.assert_allclose(np.diff(phi), 0.3, atol=1e-9)


def test_one_file_may_give_rows_to_two_parts(tmp_path):
    write_run(tmp_path / "a.csv")
    text = HEAD + TRAIN + 'rows = [0, 60]\n[test]\nfiles = ["a.csv"]\nrows = [-40]\n'
    dataset = read_dataset(described(tmp_path, text))
    assert (len(dataset.train[0]), len(dataset.test[0])) == (60, 40)


@pytest.mark.parametrize("part", ["test", "validation"])
def test_training_rows_in_another_part_are_refused(tmp_path, part):
    write_run(tmp_path / "a.csv")
    (tmp_path / "link.csv").symlink_to(tmp_path / "a.csv")
    text = HEAD + TRAIN + f'rows = [0, 61]\n[{part}]\nfiles = ["link.csv"]\nrows = [-40]\n'
    with pytest.raises(
        DataError, match=rf"\[train\] and \[{part}\] must have no rows in common; both have rows 60 to 60"
    ):
        read_dataset(described(tmp_path, text))


def test_a_copy_of_a_training_file_is_refused_as_a_test(tmp_path):
    write_run(tmp_path / "a.csv")
    write_run(tmp_path / "b.csv")
    with pytest.raises(DataError, match="`b` of `test` must not be a recording of `train`"):
        read_dataset(described(tmp_path, HEAD + TRAIN + '[test]\nfiles = ["b.csv"]\n'))


def test_a_table_with_a_header_only_is_too_short(tmp_path):
    (tmp_path / "a.csv").write_text("t,x,phi,vx,vphi,u\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"a\.csv`: a recording must have at least 2 rows; got 0\. Leave it out\."):
        read_dataset(described(tmp_path, HEAD + TRAIN))


BAD = [
    (
        HEAD.replace("R1 T1", "T3") + TRAIN,
        r"arm.toml`: `space` must have one coordinate .*; `T3` has 3, `positions` has 2",
    ),
    (HEAD.replace("R1 T1", "S2") + TRAIN, "arm.toml`: `space` must be factors R<n>"),
    (HEAD.replace('"vphi"', '"omega"') + TRAIN, "a.csv`: no column `omega`; found `t, x, phi, vx, vphi, u`"),
    (
        HEAD.replace('"t"', '"vphi"').replace('velocities = ["vx", "vphi"]\n', "") + TRAIN,
        r"column `vphi`, line 3 \(row 1\): times must .* got 15.0 after 15.0",
    ),
    (HEAD + TRAIN + "rows = [99]\n", "a.csv`: a recording must have at least 2 rows; got 1, from row 99 on"),
    (HEAD + TRAIN + "rows = [30, 20]\n", r"a.csv` has 100, and none of them is in \[30, 20\]"),
    ("initial_samples = 100\n" + HEAD + TRAIN, "`a`: `initial_samples` must be .*; got 100 of 100"),
    (
        "input_matrix = [[1, 0], [0, 1]]\n" + HEAD + TRAIN,
        r"`input_matrix` must be 2 × 1 \(coordinates × inputs\); got 2 × 2",
    ),
    ("resample = 10\n" + HEAD + TRAIN, "`a`: `resample` must give 2 to"),
    (HEAD + TRAIN + "split_every = 0.01\n", "`a`: `split_every` must leave at least 2 samples"),
    (HEAD + TRAIN.replace("a.csv", "z.csv"), "arm.toml`: no file matches `z.csv`"),
]


@pytest.mark.parametrize(("text", "message"), BAD, ids=[message for _, message in BAD])
def test_what_does_not_fit_together_is_refused(tmp_path, text, message):
    write_run(tmp_path / "a.csv")
    with pytest.raises(DataError, match=message):
        read_dataset(described(tmp_path, text))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"velocities": '"v"', "v": np.zeros((9, 1))},
            "velocities or momenta must have one column per position, 2; got 1",
        ),
        ({"positions": '"v"', "v": np.zeros((9, 3))}, "a.npz`: `space` must have one coordinate per position column"),
        ({"time": '"v"', "v": np.zeros((9, 2))}, "`v` must be one column of times; got 2 columns"),
    ],
)
def test_variables_of_a_wrong_width_are_refused(tmp_path, changes, message):
    np.savez(tmp_path / "a.npz", t=np.arange(9.0), q=np.zeros((9, 2)), w=np.zeros((9, 2)), v=changes.pop("v"))
    keys = {"space": '"R2"', "time": '"t"', "positions": '"q"', "velocities": '"w"', **changes}
    text = "".join(f"{key} = {value}\n" for key, value in keys.items())
    with pytest.raises(DataError, match=message):
        read_dataset(described(tmp_path, text + '[train]\nfiles = ["a.npz"]\n'))


@pytest.mark.filterwarnings("ignore:.*stand out alone")  # Glitches, which `data check` names.
@pytest.mark.parametrize(
    ("name", "train", "test"),
    [
        ("dfki-c1", 7, ["20230629-143524", "20230629-144003", "20230629-154548"]),
        ("dfki-c0", 6, ["trajectory_01", "trajectory_04", "trajectory_13"]),
        ("multiarm-double", 26, ["double#1", "double#2", "double#3", "double#4"]),
        ("multiarm-single", 4, ["single#1", "single#2"]),
    ],
)
def test_the_examples_describe_the_measured_data(shared_data, monkeypatch, name, train, test):
    monkeypatch.setenv("SYMODEN_DATA", str(shared_data))
    dataset = read_dataset(EXAMPLES / f"{name}.toml")
    assert len(dataset.train) == train
    assert [recording.name for recording in dataset.test] == test
    for recording in dataset.recordings:
        np.testing.assert_allclose(np.diff(recording.ts), 0.01)
        slopes = np.gradient(recording.q, recording.ts, axis=0)
        error = np.sqrt(((slopes - recording.rates)[2:-2] ** 2).mean())
        assert error < 0.05 * np.sqrt((recording.rates**2).mean()) + 0.15


@pytest.mark.filterwarnings("ignore:.*stand out alone")  # Glitches, which `data check` names.
def test_the_identification_part_of_the_multiarm_files_is_the_files_own(shared_data, monkeypatch):
    monkeypatch.setenv("SYMODEN_DATA", str(shared_data))
    for name in ("single", "double"):
        file = np.load(shared_data / "multiarm-pendulum" / f"{name}.npz")
        dataset = read_dataset(EXAMPLES / f"multiarm-{name}.toml")
        assert dataset.test[0].ts[0] == file["t"][int(file["n_id"])]
        assert dataset.train[-1].ts[-1] <= file["t"][int(file["n_id"]) - 1]


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path):
    for k, folder in enumerate(("x/monday", "y/monday", "x/tuesday")):
        (tmp_path / folder).mkdir(parents=True)
        write_run(tmp_path / folder / "run.csv", seed=k)
    write_run(tmp_path / "x" / "other.csv", seed=4)
    write_run(tmp_path / "run.csv", seed=5)
    text = HEAD + '[train]\nfiles = ["?/**/*.csv"]\n[test]\nfiles = ["run.csv"]\n'
    dataset = read_dataset(described(tmp_path, text))
    names = ["x-monday-run", "other", "tuesday-run", "y-monday-run"]
    assert sorted(each.name for each in dataset.train) == sorted(names)
    assert [each.name for each in dataset.test] == ["run"]  # Parts are told apart anyway.


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (("/arm/angle/data", "/arm/volt/data"), ("angle", "volt")),
        (("/js/hip/position", "/js/hip/effort"), ("position", "effort")),
        (("a/q", "b/q"), ("a", "b")),
        (("q", "u"), ("q", "u")),
        (("x (l/r)", "u [N/A]"), ("x (l/r)", "u [N/A]")),
        (("run/q", "u"), ("run/q", "u")),
    ],
)
def test_topics_are_named_without_what_all_of_them_begin_and_end_with(tmp_path, names, short):
    t = np.linspace(0.0, 2.0, 201)
    rows = np.stack([t, np.sin(3 * t), np.cos(t)], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=",".join(["t", *names]), comments="")
    path = tmp_path / "arm.toml"
    path.write_text(
        f'space = "R1"\ntime = "t"\npositions = ["{names[0]}"]\ninputs = ["{names[1]}"]\n[train]\nfiles = ["a.csv"]\n'
    )
    dataset = read_dataset(path)
    assert (*dataset.position_names, *dataset.input_names) == short


@pytest.mark.parametrize(
    ("keys", "delay", "lag"),
    [
        ("", 0.0, ()),
        ("input_delay = 0.03\ninput_lag = 0.1\n", 0.03, (0.1,)),
        ("input_delay = -0.01\ninput_lag = 0\n", 0.0, ()),  # Logged late: what acts is no later for that.
        ("input_delay = 0.03\nposition_delay = [0, 0.02]\n", 0.05, ()),
    ],
)
def test_how_late_a_machine_answers_is_kept_for_its_controllers(tmp_path, keys, delay, lag):
    write_run(tmp_path / "a.csv", samples=200)
    dataset = read_dataset(described(tmp_path, keys + HEAD.replace('velocities = ["vx", "vphi"]\n', "") + TRAIN))
    assert (dataset.delay, dataset.lag) == (delay, lag)
