"""Files with arrays of several recordings, told apart by what a star in their names stands for."""

import h5py
import numpy as np
import pytest

from symoden.data import DataError, read_dataset
from symoden.data.files._arrays import spelt_out, starred
from symoden.data.files._readers import read_rows

ALL = slice(0, None)
LENGTHS = {"2": 30, "10": 40, "lift": 50}


def recorded(label, *, width=1):
    ts = 0.05 * np.arange(LENGTHS[label])
    return {"t": ts, "q": np.repeat(np.sin(3 * ts + len(label))[:, None], width, axis=1), "u": np.cos(ts)}


def saved(path, recordings, **common):
    arrays = {f"data/demo_{label}/{name}": x for label, each in recordings.items() for name, x in each.items()}
    if path.suffix == ".npz":
        np.savez(path, **arrays, **common)
        return path
    with h5py.File(path, "w") as file:
        for name, array in (arrays | common).items():
            file[name] = array
    return path


SELECTORS = {"time": "data/demo_*/t", "positions": "data/demo_*/q", "inputs": ("data/demo_*/u",)}


@pytest.mark.parametrize("suffix", [".h5", ".npz"])
def test_a_star_stands_for_a_recording_in_the_order_of_its_number(tmp_path, suffix):
    recordings = {label: recorded(label) for label in ("10", "lift", "2")}
    rows = read_rows(saved(tmp_path / f"demos{suffix}", recordings), SELECTORS, slice(5, None))
    assert rows.labels is not None
    kept = {label: rows.take(np.flatnonzero(rows.labels == label), label) for label in LENGTHS}
    for label, found in kept.items():
        for role, name in (("time", "t"), ("positions", "q"), ("inputs", "u")):
            np.testing.assert_array_equal(found.signals[role].ravel(), recordings[label][name].ravel()[5:])
    assert list(dict.fromkeys(rows.labels)) == ["2", "10", "lift"]
    assert len(set(rows.index)) == len(rows)


def test_recordings_of_a_file_are_shared_out_by_their_names(tmp_path):
    saved(tmp_path / "demos.h5", {label: recorded(label) for label in LENGTHS})
    (tmp_path / "arm.toml").write_text(
        'space = "T1"\ntime = "data/demo_*/t"\npositions = ["data/demo_*/q[0]"]\ninputs = ["data/demo_*/u"]\n'
        '[train]\nfiles = ["demos.h5"]\n[test]\nfiles = ["demos.h5"]\nrecordings = ["lift", 2]\n'
    )
    data = read_dataset(tmp_path / "arm.toml")
    assert [len(each) for each in data.train] == [40]
    assert sorted(len(each) for each in data.test) == [30, 50]


def test_a_name_without_a_star_belongs_to_every_recording(tmp_path):
    one = recorded("2")
    shared = {label: {"q": one["q"], "u": one["u"]} for label in ("2", "10")}
    rows = read_rows(saved(tmp_path / "demos.h5", shared, t=one["t"]), SELECTORS | {"time": "t"}, ALL)
    np.testing.assert_array_equal(rows.signals["time"][:, 0], np.tile(one["t"], 2))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda each: each["10"].pop("u"), r"no variable `data/demo_10/u`"),
        (lambda each: each["10"].update(u=np.ones(3)), r"`data/demo_\*/u` 3 × 1"),
        (lambda each: each.update({"10": recorded("10", width=2)}), r"as many columns in each recording; got 1 and 2"),
        (lambda each: [x.pop("q") for x in each.values()], r"no variable `data/demo_\*/q`; found"),
    ],
)
def test_what_a_recording_lacks_is_named(tmp_path, change, said):
    recordings = {label: recorded(label) for label in LENGTHS}
    change(recordings)
    with pytest.raises(DataError, match=said):
        read_rows(saved(tmp_path / "demos.h5", recordings), SELECTORS, ALL)


def test_a_column_that_tells_recordings_too_is_refused(tmp_path):
    path = saved(tmp_path / "demos.h5", {"2": recorded("2")}, trial=np.zeros(30))
    with pytest.raises(DataError, match=r"the star .* got `recording` = 'trial' as well"):
        read_rows(path, SELECTORS, ALL, "trial")


def test_stars_stand_for_one_text_without_slashes():
    assert starred("demo_*/q", "demo_12/q") == "12"
    assert starred("demo_*/q", "demo_1/2/q") is None
    assert starred("*/run_*", "a/run_a") == "a"
    assert starred("*/run_*", "a/run_b") is None
    assert starred("q.*", "qx1") is None
    assert spelt_out(["a*", "b", "c*"], ["a1", "a2", "b", "c*"]) == ["a1", "a2", "b", "c*"]


def test_a_star_sees_what_is_behind_links_and_slashes(tmp_path):
    path = saved(tmp_path / "demos.h5", {"2": recorded("2"), "10": recorded("10")})
    with h5py.File(path, "a") as file:
        file["other"] = h5py.SoftLink("/data")
        del file["data/demo_10/t"]
        file["data/demo_10/t"] = file["data/demo_2/t"]  # One clock, which both have.
        for name in ("q", "u"):
            values = recorded("10")[name][:30]
            del file[f"data/demo_10/{name}"]
            file[f"data/demo_10/{name}"] = values
        file["data/demo_empty/notes"] = np.zeros(3)
        file["data/demo_lost"] = h5py.SoftLink("/nowhere")
        file["data/demo_latest"] = h5py.SoftLink("/data/demo_2")  # It is one recording all the same.
        file["data/demo_away"] = h5py.ExternalLink("elsewhere.h5", "/")
        file.create_group("data/demo_2/raw_notes")
        file["data/demo_2/raw_q"] = np.zeros(30)
    with h5py.File(tmp_path / "elsewhere.h5", "w") as file:
        file["t"], file["q"] = np.zeros((2, 30))
    for folder in ("data", "/data", "other"):
        selectors = {"time": f"{folder}/demo_*/t", "positions": f"{folder}/demo_*/q"}
        rows = read_rows(path, selectors, ALL)
        assert rows.labels is not None
        assert list(rows.labels) == ["2"] * 30 + ["10"] * 30
        first, second = np.split(rows.signals["time"][:, 0], 2)
        np.testing.assert_array_equal(first, second)
    rows = read_rows(path, {"positions": "data/demo_2/raw_*"}, ALL)
    assert rows.labels is not None
    assert list(rows.labels) == ["q"] * 30


def test_a_star_stands_for_a_struct_of_a_matlab_file(tmp_path):
    with h5py.File(tmp_path / "demos.mat", "w", userblock_size=512) as file:
        for label in LENGTHS:
            for name, array in recorded(label).items():
                file[f"demo_{label}/{name}"] = array.reshape(-1, 1).T
            file[f"demo_{label}/smooth/q"] = np.zeros((1, LENGTHS[label]))
    with (tmp_path / "demos.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    selectors = {"time": "demo_*.t", "positions": ("demo_*.q",), "inputs": ("demo_*.smooth.q",)}
    rows = read_rows(tmp_path / "demos.mat", selectors, ALL)
    assert rows.labels is not None
    assert list(dict.fromkeys(rows.labels)) == ["2", "10", "lift"]
    assert len(rows) == sum(LENGTHS.values())
