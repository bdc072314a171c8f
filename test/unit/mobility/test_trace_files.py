"""Recorded motion: BonnMotion, ns-2 and CSV."""

from __future__ import annotations

import gzip

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility import Area, Mobility, tracks_of
from drone_mesh.mobility.trace_files import read_trace, write_csv

FITS_BOTH = "0 0 0 2 10 0 20 2 20 30 40 2\n"  # a line of BonnMotion: t x y, or t x y z


def read(tmp_path, text, name="trace.txt"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return read_trace(path)


def test_bonnmotion_has_a_line_for_each_drone(tmp_path):
    knots = read(tmp_path, "0.0 1.0 2.0 10.0 3.0 4.0\n0.0 5.0 6.0\n")
    assert knots == {
        0: [(0.0, 1.0, 2.0, 0.0), (10.0, 3.0, 4.0, 0.0)],
        1: [(0.0, 5.0, 6.0, 0.0)],
    }


def test_bonnmotion_in_three_dimensions_is_recognised_by_its_times(tmp_path):
    knots = read(tmp_path, "0.0 9.0 8.0 7.0 5.0 1.0 2.0 3.0 9.0 4.0 4.0 4.0\n")
    assert knots == {0: [(0.0, 9.0, 8.0, 7.0), (5.0, 1.0, 2.0, 3.0), (9.0, 4.0, 4.0, 4.0)]}


def test_bonnmotions_own_files_in_three_dimensions_begin_with_their_kind(tmp_path):
    assert read(tmp_path, f"#3D\n{FITS_BOTH}") == {
        0: [(0.0, 0.0, 0.0, 2.0), (10.0, 0.0, 20.0, 2.0), (20.0, 30.0, 40.0, 2.0)]
    }
    assert read(tmp_path, f"#2D\n{FITS_BOTH}") == {
        0: [
            (0.0, 0.0, 0.0, 0.0),
            (2.0, 10.0, 0.0, 0.0),
            (20.0, 2.0, 20.0, 0.0),
            (30.0, 40.0, 2.0, 0.0),
        ]
    }


def test_one_line_that_fits_only_one_kind_decides_for_all(tmp_path):
    knots = read(tmp_path, f"{FITS_BOTH}0 1 1 2 10 5 5 2\n")
    assert [len(knots[node]) for node in (0, 1)] == [3, 2]


def test_comments_of_bonnmotion_are_no_drones(tmp_path):
    assert read(tmp_path, "# by hand\n0 1 2\n\n# the other\n0 3 4\n") == {
        0: [(0.0, 1.0, 2.0, 0.0)],
        1: [(0.0, 3.0, 4.0, 0.0)],
    }


def test_bonnmotions_own_compressed_files_are_read(tmp_path):
    path = tmp_path / "scenario.movements.gz"
    path.write_bytes(gzip.compress(b"0.0 1.0 2.0\n"))
    assert read_trace(path) == {0: [(0.0, 1.0, 2.0, 0.0)]}


def test_a_damaged_or_cut_off_compressed_file_is_named(tmp_path):
    path = tmp_path / "scenario.movements.gz"
    whole = gzip.compress(b"0.0 1.0 2.0\n" * 100)
    for content in (whole[:-12], whole[:10] + bytes(20) + whole[30:]):
        path.write_bytes(content)
        with pytest.raises(ConfigurationError, match=r"trace .*movements\.gz: damaged or cut off"):
            read_trace(path)


def test_a_compressed_file_that_unpacks_to_gigabytes_is_refused_at_once(tmp_path):
    path = tmp_path / "scenario.movements.gz"
    path.write_bytes(gzip.compress(bytes(50_000_001)))
    with pytest.raises(ConfigurationError, match="larger than 50000000 bytes"):
        read_trace(path)


def test_ns2_nodes_fly_to_their_destinations_until_a_new_one_comes(tmp_path):
    knots = read(
        tmp_path,
        "# nodes: 2\n"
        "$node_(0) set X_ 1.0\n"
        "$node_(0) set Y_ 2.0\n"
        "$node_(0) set Z_ 0.0\n"
        "$node_(1) set X_ 0.0\n"
        "$god_ set-dist 0 1 1\n"
        '$ns_ at 1.0 "$god_ set-dist 0 1 2"\n'
        "\n"
        '$ns_ at 2.0 "$node_(0) setdest 1.0 12.0 2.0"\n'
        '$ns_ at 4.0 "$node_(0) setdest 7.0 6.0 3.0"\n',
    )
    assert knots[0] == [
        (0.0, 1.0, 2.0, 0.0),
        (2.0, 1.0, 2.0, 0.0),
        (4.0, 1.0, 6.0, 0.0),
        (4.0, 1.0, 6.0, 0.0),
        (6.0, 7.0, 6.0, 0.0),
    ]
    assert knots[1] == [(0.0, 0.0, 0.0, 0.0)]


def test_of_two_ns2_destinations_at_one_time_the_later_line_counts(tmp_path):
    knots = read(
        tmp_path,
        "$node_(0) set X_ 0.0\n"
        '$ns_ at 2.0 "$node_(0) setdest 9.0 0.0 1.0"\n'
        '$ns_ at 2.0 "$node_(0) setdest 3.0 0.0 1.0"\n',
    )
    assert knots[0][-1] == (5.0, 3.0, 0.0, 0.0)


def test_an_ns2_destination_may_be_repeated_and_a_flight_may_end_within_a_rounding_error(tmp_path):
    for x in ("3.0", "0.30000000000000004"):  # 0.1 + 0.2, when 0.3 is the next destination
        knots = read(
            tmp_path,
            "$node_(0) set X_ 0.0\n"
            f'$ns_ at 1.0 "$node_(0) setdest {x} 0.0 0.1"\n'
            f'$ns_ at 100.0 "$node_(0) setdest {x[:3]} 0.0 0.1"\n'
            f'$ns_ at 1e8 "$node_(0) setdest {x} 0.0 20.0"\n',
        )
        assert knots[0][-1][1] == pytest.approx(float(x))
        mobility = Mobility("trace", knots=knots)
        (track,) = tracks_of(mobility, {0: (0, 0, 0)}, (), Area(0, 0, 1, 1), 1).values()
        assert track.position_at(2e8)[0] == pytest.approx(float(x))


def test_ns2_statements_are_those_that_ns3_reads(tmp_path):
    knots = read(
        tmp_path,
        "set god_ [God instance]\n"
        "set opt(nn) 2 ;# nodes\n"
        '$ns_ at 2.0 "$node_(0) setdest 1.0 12.0 2.0  "; # fly\n'
        '$ns_ at 4.0 "$node_(0) set X_ 9"\n'
        '$ns_ at 4.0 "$node_(0) set Z_ 3 "\n'
        '$ns_ at 5.0 "$node_(0) setdest 9 6 1"\n'
        "$node_(0) set X_ 1.0 # the start may come last\n"
        "$node_(0) set Y_ 2.0;\n"
        '$ns_ at 1.0 "$node_(1) setdest 3.0 4.0 5.0"\n',
    )
    start = (0.0, 0.0, 0.0)  # as there, of a node without one
    assert knots[1] == [(0.0, *start), (1.0, *start), (2.0, 3.0, 4.0, 0.0)]
    mobility = Mobility("trace", knots={0: knots[0]})
    (track,) = tracks_of(mobility, {0: (0, 0, 0)}, (), Area(0, 0, 1, 1), 1).values()
    places = [track.position_at(t) for t in (0.0, 3.0, 4.0, 4.5, 5.0)]
    assert places == [(1, 2, 0), (1, 4, 0), (9, 6, 3), (9, 6, 3), (9, 6, 3)]


def test_an_ns2_speed_that_is_hardly_more_than_zero_is_a_rest(tmp_path):
    order = '$ns_ at 2.0 "$node_(0) setdest 3.0 4.0 1e-300"\n'
    assert read(tmp_path, order) == {0: [(0.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0)]}


def test_csv_rows_may_come_in_any_order(tmp_path):
    knots = read(tmp_path, "t,id,x,y,z\n1.0,4,3,3,0\n0.0,4,1,2,0\n0.5,2,9,9,1\n")
    assert knots == {2: [(0.5, 9.0, 9.0, 1.0)], 4: [(0.0, 1.0, 2.0, 0.0), (1.0, 3.0, 3.0, 0.0)]}


def test_csv_may_have_quoted_words(tmp_path):
    text = '"t", "id", "x", "y", "z"\n"1.0", "4", "3", "3", "0"\n'
    assert read(tmp_path, text) == {4: [(1.0, 3.0, 3.0, 0.0)]}


def test_csv_may_begin_with_a_byte_order_mark(tmp_path):
    assert read(tmp_path, "\ufefft,id,x,y,z\r\n1.0,4,3,3,0\r\n") == {4: [(1.0, 3.0, 3.0, 0.0)]}


NS2 = "$node_(1) set X_ 4.0\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no drone"),
        ("t;id;x;y;z\n0;1;0;0;2\n", "line 1: expected the header t,id,x,y,z, not 't;id;x;y;z'"),
        ("time,node,x,y,z\n0,1,0,0,2\n", "line 1: expected the header t,id,x,y,z, not 'time,"),
        ("t id x y z\n0 1 0 0 2\n", "line 1: expected the header t,id,x,y,z"),
        ("t,id,x,y,z\n0,1,0,0,2\n1,1,nan,0,2\n", "line 3: expected numbers, not x nan"),
        ("t,id,x,y,z\n0,1.5,0,0,2\n", "line 2: id 1.5 must be a whole number"),
        ("t,id,x,y,z\n0,1,5,5,2\n0,1,0,0,2\n", "drone 1 is at two places at 0 s"),
        (f'{NS2}$ns_ at 2.0 "$node_(1) setdst 3 4 1"\n', "line 2: expected .*, not .*setdst"),
        (f'{NS2}$ns at 2.0 "$node_(1) setdest 3 4 1"\n', "line 2: expected .*, not '.ns at"),
        (f'{NS2}$ns_ at 2.0 "$node_(1) setdest 3 4 5 1"\n', "line 2: expected .* setdest X Y"),
        (f'{NS2}$ns_ at 2.0 "$node_(1) setdest 3 4 -1.5"\n', "line 2: .* speed -1.5 must be 0"),
        (f'{NS2}$ns_ at -2.0 "$node_(1) setdest 3 4 1"\n', "line 2: time -2.0 .* must be 0"),
        (f'{NS2}$ns_ at 2.0 "$node_(1) set X_ far"\n', "line 2: expected numbers, not far"),
        (
            f'{NS2}$ns_ at 2.0 "$node_(1) setdest 3 1e308 1"\n',
            "line 2: expected numbers, not 1e308",
        ),
        ("0.0 1e308 1e308\n", "line 1: expected numbers, not 1e308"),
        ("t,id,x,y,z\n1,2,3\n", "line 2: expected t,id,x,y,z"),
        ("t,id,x,y,z\n0,٣,0,0,2\n", "line 2: id ٣ must be a whole number"),
        ("0.0 1.0 two\n", "line 1: expected numbers"),
        ("$node_(٣) set X_ 1\n", "line 1: expected .node_"),
        (
            '{"uptime_s": 1, "nodes": [{"id": 1, "place": ["nan", 0, 0]}]}\n',
            "must be three numbers",
        ),
        ('{"uptime_s": 1, "nodes": [{"id": 1, "place": [NaN, 0, 0]}]}\n', "must be three numbers"),
        ("{" + '"a":[' * 9_000 + "\n", "no line is an answer"),
        ("5.0 1.0 2.0 4.0 1.0 2.0\n", "rising t"),
        (FITS_BOTH, "fits both t x y and t x y z: .* first line #2D or #3D"),
        ("0 1 1 9 2 2\n0 1 1 2 9 2 2 2\n", "lines of t x y and lines of t x y z"),
        ("#3D\n0 1 1\n", "line 2: expected t x y z again and again"),
        ("0 1 1 10 5 5 10 6 6\n", "line 1: .* rising t"),
        ("0 1 1 10 5\n", "line 1: expected t x y or t x y z"),
    ],
)
def test_a_file_that_is_no_trace_is_named_with_the_line(tmp_path, text, words):
    with pytest.raises(ConfigurationError, match=f"trace .*trace.txt: .*{words}"):
        read(tmp_path, text)


def test_a_written_trace_is_read_again(tmp_path):
    path = tmp_path / "flight.csv"
    write_csv(path, [(0.0, 3, 1.0, 2.0, 0.5), (0.0, 1, 4.0, 4.0, 0.0), (1.25, 3, 1.5, 2.0, 0.5)])
    assert read_trace(path) == {
        1: [(0.0, 4.0, 4.0, 0.0)],
        3: [(0.0, 1.0, 2.0, 0.5), (1.25, 1.5, 2.0, 0.5)],
    }


def test_a_missing_trace_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match="no-such"):
        read_trace(tmp_path / "no-such")


def test_drones_fly_a_trace_and_rest_before_and_after_it():
    knots = {1: [(2.0, 0.0, 0.0, 1.0), (4.0, 8.0, 0.0, 1.0)]}
    places = {0: (0.0, 0.0, 0.0), 1: (3.0, 3.0, 0.0), 2: (5.0, 5.0, 0.0)}
    mobility = Mobility("trace", knots=knots)
    (track,) = tracks_of(mobility, places, {0}, Area(0, 0, 1, 1), 1).values()
    assert [track.position_at(t)[0] for t in (0.0, 2.0, 3.0, 4.0, 9.0)] == [0.0, 0.0, 4.0, 8.0, 8.0]


def test_a_trace_moves_every_drone_that_it_names_gateways_included():
    knots = {0: [(0.0, 0.0, 0.0, 1.0), (4.0, 8.0, 0.0, 1.0)], 2: [(0.0, 5.0, 5.0, 0.0)]}
    places = {node: (3.0, 3.0, 0.0) for node in range(3)}
    tracks = tracks_of(Mobility("trace", knots=knots), places, {0}, Area(0, 0, 1, 1), 1)
    assert {node: track.position_at(2.0) for node, track in tracks.items()} == {
        0: (4.0, 0.0, 1.0),
        2: (5.0, 5.0, 0.0),
    }


def test_a_trace_of_a_drone_that_is_not_there_is_refused():
    mobility = Mobility("trace", knots={7: [(0.0, 0.0, 0.0, 1.0)]})
    places = {node: (3.0, 3.0, 0.0) for node in range(3)}
    with pytest.raises(ConfigurationError, match=r"the trace names drone 7; the drones are 0\.\.2"):
        tracks_of(mobility, places, (), Area(0, 0, 1, 1), 1)


def test_a_file_that_is_no_text_is_named(tmp_path):
    path = tmp_path / "flight.csv"
    path.write_bytes("t,id,x,y,z\n0,1,0,0,2 \u00e9\n".encode("latin-1"))
    with pytest.raises(ConfigurationError, match="flight.csv: not a text file in UTF-8"):
        read_trace(path)
