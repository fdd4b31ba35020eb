"""Where rows begin, and what columns are called, is told from the lines themselves."""

import pytest

from symoden.data.files._layout import find_layout

LAYOUTS = [
    (",1,2\n0,q,u\n", ["", "1", "2"], 2),  # The index of a table whose columns only count.
    ("0,1,2\n0.1,2,3\n", ["0", "1", "2"], 2),
    ("t,1,2\n0,1,2\n", ["t", "1", "2"], 2),
    ("nan,inf,t\n1,2,3\n", ["nan", "inf", "t"], 2),
    ("q,u\n-,-\n1,2\n", ["q", "u"], 2),  # What is no unit stays, and is refused by its line.
    ("q,u\nTrue,False\n1,2\n", ["q", "u"], 2),
    ("t,q\nms,deg/s^2\n0,1\n", ["t", "q"], 3),
    ("# t,q\ns,rad\n0,1\n1,2\n", ["t", "q"], 3),
    ("# t,q\n# s,rad\n0,1\n", ["t", "q"], 3),
    ("# a, b, c\n0 1.5 2\n", ["a", "b", "c"], 2),
    ("t,q\n# hello, you\n0,1\n", ["t", "q"], 3),
    ("t|q|u\ns|mm|A\n0.1|1|2\n0.2|2|3\n", ["t", "q", "u"], 3),
    ("t | q\n0,1 | 1\n0,2 | 2\n", ["t", "q"], 2),
    ("t,|v|\n0,1\n1,2\n", ["t", "|v|"], 2),
    ("joint 1\n0.5\n0.6\n", ["joint 1"], 2),
    ("\tt\tq\n1\t0\t2\n", ["", "t", "q"], 2),
    ('t,q\n"never closed', ["t", "q"], 2),
    ("# t,q\n", ["t", "q"], 3),
    ("Booting\nsketch 1.2, gain 3, rate 9\nt\tq\n0\t1\n1\t2\n2\t3\n", ["t", "q"], 4),
    ("Test of 3 May\nt,q\ns,deg\n0,1\n1,2\n2,3\n", ["t", "q"], 4),
    ("Booting\nall is well\n0;5\n1;2\n2;3\n", ["1", "2"], 3),
    ("Booting\n\n# a remark\nt q u\n0 1 2\n1 2 3\n2 3 4\n", ["t", "q", "u"], 5),
    ("one, two\nthree\n0,1\n1,2\n2,3\n", ["one", "two"], 2),  # Names come first; what follows is named by its line.
    ("t,q,u\n0.0,1,2,\n0.1,1,2,\n0.2,1,2,\n0.3,1,2,\n", ["t", "q", "u"], 2),
    ("t;q;\n0.0;1;;\n0.1;1;;\n0.2;1;;\n0.3;1;;\n", ["t", "q", ""], 2),
    ("t,q,u,comment\n0,1,2,start\n0.1,1,2\n0.2,1,2\n0.3,1,2\n", ["t", "q", "u", "comment"], 2),
    ("t q u\n0 1 2\n0.1 1\n0.2 1\n0.3 1\n0.4 1 2\n", ["t", "q", "u"], 2),
    ("t,q,mode\n" + "0.1,1,run\n" * 9 + "0.1,1\n" * 9, ["t", "q", "mode"], 2),
    ("t q\n1 0.1 2\n2 0.2 2\n3 0.3 2\n4 0.4 2\n", ["t q"], 2),  # As R writes it: refused by its line.
    (" Time   Encoder 1 Pos   Effort\n\n0 1 2\n1 2 3\n2 3 4\n3 4 5\n", ["Time", "Encoder 1 Pos", "Effort"], 3),
    (" Time   Encoder 1   Effort\n s   counts   V\n0 1 2\n1 2 3\n", ["Time", "Encoder 1", "Effort"], 3),
    (" Time   Encoder 1   Effort\n s   counts   V\n" + "0 1 2\n1 2 3\n" * 3, ["Time", "Encoder 1", "Effort"], 3),
    ("% Time   Encoder 1 Pos   Effort\n" + "0 1 2\n1 2 3\n" * 3, ["Time", "Encoder 1 Pos", "Effort"], 2),
    ("0.0 1.5 2.5\n0.1 1.5\n0.2 1 2\n", ["1", "2", "3"], 1),
    ("q\n0,5\n0,6\n0,7\n0,8\n", ["q"], 2),
    ("Boot\nt,q,u\n0,err,1\n0.1,2,3\n0.2,2,3\n0.3,2,3\n", ["t", "q", "u"], 3),
    ("Boot\nt,q,u\n,,\n0.1,2,3\n0.2,2,3\n0.3,2,3\n", ["t", "q", "u"], 3),
    ("Boot\nt,q,u\nsec,degC,lbf\n0.1,2,3\n0.2,2,3\n0.3,2,3\n", ["t", "q", "u"], 3),
    ("Logger v5\nt,q\n10:00:00,1\n10:00:01,nan\n10:00:02,3\n", ["t", "q"], 3),
    (
        "Logger v5\nt,q\n2025-10-09T08:53:20Z,1\n2025-10-09T08:53:21Z,2\n2025-10-09T08:53:22Z,3\n",
        ["t", "q"],
        3,
    ),
]


@pytest.mark.parametrize(("text", "names", "line"), LAYOUTS)
def test_names_units_and_comments_are_told_from_rows(text, names, line):
    layout = find_layout(text)
    assert list(layout.names) == names
    assert layout.line == line
    assert text[: layout.start].count("\n") == min(line, text.count("\n") + 1) - 1
