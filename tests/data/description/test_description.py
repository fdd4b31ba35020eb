"""A description says what it says: every key is known, every value is fit, and a misspelt key fails."""

import pytest

from symoden.data import DataError
from symoden.data.description._description import Part, read_description

LEAST = 'space = "T1"\ntime = "t"\npositions = ["q"]\n[train]\nfiles = ["a.csv"]\n'
FULL = """
space = "R1 T1"
dt = 1
positions = "q"
momenta = ["p[0]", "p[1]"]
inputs = []
hold = "linear"
resample = 0.01
input_matrix = [[1, 0.5], [0, -1]]
initial_samples = 3
[train]
files = ["a.csv", "b*.csv"]
rows = [5, -1]
split_every = 2.67
[test]
files = ["c.csv"]
rows = [7]
[validation]
files = ["d.csv"]
"""


def described(tmp_path, text, **options):
    path = tmp_path / "arm.toml"
    path.write_text(text, encoding="utf-8")
    return read_description(path, **options)


def test_what_is_not_said_has_its_default(tmp_path):
    description = described(tmp_path, LEAST)
    assert (description.space, description.time, description.positions) == ("T1", "t", ("q",))
    assert description.train == Part(files=("a.csv",), rows={}, split_every=None)
    assert (description.inputs, description.hold, description.initial_samples) == ((), "zero", 1)
    unsaid = ("dt", "velocities", "momenta", "resample", "input_matrix", "test", "validation")
    assert all(getattr(description, key) is None for key in unsaid)


def test_every_key_has_an_effect(tmp_path):
    description = described(tmp_path, FULL)
    assert (description.space, description.dt, description.positions) == ("R1 T1", 1.0, "q")
    assert (description.momenta, description.hold, description.resample) == (("p[0]", "p[1]"), "linear", 0.01)
    assert (description.input_matrix, description.initial_samples) == (((1.0, 0.5), (0.0, -1.0)), 3)
    assert description.train == Part(files=("a.csv", "b*.csv"), rows={"*": ((5, -1),)}, split_every=2.67)
    assert description.test == Part(files=("c.csv",), rows={"*": ((7, None),)})
    assert description.validation == Part(files=("d.csv",))


def test_a_space_given_beside_it_replaces_the_descriptions(tmp_path):
    assert described(tmp_path, LEAST, space="R1").space == "R1"
    assert described(tmp_path, LEAST.replace('space = "T1"\n', ""), space="R1").space == "R1"


def with_top(line):
    return f"{line}\n{LEAST}"


BAD = [
    (
        with_top('velocity = ["v"]'),
        r"a description has no key `velocity`\. Did you mean `velocities`\? The keys are `sp",
    ),
    (with_top("Dt = 1"), r"no key `Dt`\. Did you mean `dt`\?"),
    (
        with_top("estimated_velocities = {noise_gain = [3], one_sided = 0}"),
        r"is about `velocities`, which are not given",
    ),
    *(
        (with_top(f'velocities = ["v"]\nestimated_velocities = {{{said}}}'), message)
        for said, message in (
            ("noise_gain = [3]", "must be a table of both noise_gain and one_sided"),
            ("noise_gain = 3, one_sided = 0", "must be a table of both noise_gain and one_sided"),
            ("noise_gain = [0.0], one_sided = 0", "noise_gain is a list of positive numbers"),
            ("noise_gain = [3], one_sided = -1", "one_sided is a number of seconds, at least 0"),
        )
    ),
    (LEAST.replace("[train]", "[trains]"), r"no key `trains`\. Did you mean `train`\?"),
    (
        f"{LEAST}row = [0, 1]\n",
        r"\[train\] has no key `row`\. Did you mean `rows`\? The keys are `files, rows, recordings, split_every`",
    ),
    (
        f"{LEAST}hold = 'zero'\n",
        r"\[train\] has no key `hold`\. `hold` is a key of .* must stand above all tables\. Move",
    ),
    (f"{LEAST}[known]\nresample = 1\n", r"\[known\] has no key `resample`\. `resample` is a key of the whole desc"),
    (LEAST.replace('space = "T1"\n', ""), "`space` must be given; found `time, positions`"),
    (LEAST.replace("positions", "position"), r"no key `position`\. Did you mean `positions`"),
    (LEAST.replace('files = ["a.csv"]', ""), r"\[train\] `files` must be given; found nothing"),
    (LEAST.replace('["a.csv"]', '"a.csv"'), r"\[train\] `files` must be a list of texts in brackets.*; got 'a.csv'"),
    (LEAST.replace('["a.csv"]', "[]"), r"\[train\] `files` must name at least one file; got \[\]"),
    (LEAST.replace('["q"]', "[]"), r"`positions` must name at least one column; got \[\]"),
    (LEAST.replace('["q"]', '["q", "q"]'), "`positions` must be names that differ from each other"),
    (LEAST.replace('["q"]', "[1]"), "`positions` must be a list of texts"),
    (LEAST.replace('"T1"', "1"), "`space` must be a text; got 1"),
    (LEAST.replace('time = "t"', ""), "`time` .* or `dt` .* must be given; got neither"),
    (LEAST.replace('time = "t"', "dt = true"), "`dt` must be a positive number of seconds; got True"),
    (with_top("resample = nan"), "`resample` must be a positive number of seconds; got nan"),
    (with_top('hold = "cubic"'), '`hold` must be "zero" or "linear"; got \'cubic\''),
    (with_top('velocities = ["v"]\nmomenta = ["p"]'), "only one of `velocities` and `momenta`"),
    (with_top('velocities = ["v", "w"]'), "`velocities` must name 1 columns, one per position; got 2"),
    (with_top('inputs = ["u", "q"]'), "must have one meaning; got `q` in `inputs`, and `q` in `positions`. Name"),
    (with_top('momenta = ["q"]'), "got `q` in `momenta`, and `q` in `positions`"),
    (with_top('velocities = ["t"]'), "got `t` in `velocities`, and `t` in `time`"),
    (with_top('inputs = ["q[1]"]').replace('["q"]', '"q"'), r"got `q\[1\]` in `inputs`, and `q` in `positions`"),
    (with_top('recording = "u"\ninputs = ["u"]'), "got `u` in `recording`, and `u` in `inputs`. Name each column once"),
    (with_top(f"resample = 1{'0' * 400}"), "`resample` must be a positive number of seconds"),
    (with_top("input_matrix = [1, 2]"), "`input_matrix` must be a list of rows of numbers"),
    (with_top("input_matrix = [[1, 2], [3]]"), "`input_matrix` must be rows of equal length"),
    (with_top("initial_samples = 0"), "`initial_samples` must be a whole number, at least 1; got 0"),
    (f"{LEAST}rows = [1, 2, 3]\n", r"\[train\] `rows` must be \[start, stop\)"),
    (f"{LEAST}rows = [0.5]\n", r"\[train\] `rows` must be \[start, stop\)"),
    (f"{LEAST}rows = [[1, 2], 3]\n", r"\[train\] `rows` must be \[start, stop\)"),
    (f"{LEAST}rows = [[1, 2], [3, 4, 5]]\n", r"\[train\] `rows` must be .*, or a list of these"),
    (f"{LEAST}rows = {{ a = [1, 2, 3] }}\n", r"\[train\] `rows` must be .*, or a table of these by file"),
    (f"{LEAST}rows = []\n", r"\[train\] `rows` must be \[start, stop\)"),
    (f"{LEAST}split_every = -1\n", r"\[train\] `split_every` must be a positive number"),
    (LEAST.replace('[train]\nfiles = ["a.csv"]', ""), r"\[train\] or \[test\] must name `files`; got neither"),
    (
        "train = 1\n" + LEAST.replace('[train]\nfiles = ["a.csv"]', ""),
        r"\[train\] must be a table of keys, such as `files`; got 1",
    ),
    (
        with_top("position_delay = -0.1"),
        r"`position_delay` must be .*, at least 0.* `input_delay` below zero",
    ),
    (with_top('input_delay = "0.1"'), r"`input_delay` must be a number of seconds, or a list of one each; below zero"),
    (with_top("hold = zero"), r"reading stopped at: .*line 1.*, in `hold = zero`\. Names .* in quotation marks\.$"),
    (with_top("hold = '"), r"must be a TOML file; reading stopped at: .*\(at end of document\)\.$"),
]


@pytest.mark.parametrize(("text", "message"), BAD, ids=[message for _, message in BAD])
def test_a_wrong_description_is_refused(tmp_path, text, message):
    with pytest.raises(DataError, match=message) as caught:
        described(tmp_path, text)
    assert str(caught.value).startswith(f"`{tmp_path / 'arm.toml'}`: ")


def test_columns_of_one_variable_may_mean_several_things(tmp_path):
    text = with_top('velocities = ["x[1]"]\ninputs = ["x[2]"]').replace('["q"]', '["x[0]"]')
    assert described(tmp_path, text).velocities == ("x[1]",)


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "arm.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(DataError, match="must be a TOML file"):
        read_description(tmp_path / "arm.toml")


def test_an_absent_description_is_refused(tmp_path):
    with pytest.raises(DataError, match=r"arm.toml`: cannot be read: No such file or directory"):
        read_description(tmp_path / "arm.toml")
