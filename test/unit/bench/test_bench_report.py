"""The tables."""

from dataclasses import replace

from drone_mesh.bench.inprocess import InProcessResult
from drone_mesh.bench.measurement import RosResult
from drone_mesh.bench.report import inprocess_table, ros_tables, table

RESULT = RosResult(
    drones=100,
    spacing_m=6.0,
    flying=0,
    real_time_factor=1.0,
    on_after_wall_s=8.25,
    connected_after_sim_s=1.5,
    connected_after_wall_s=1.6,
    routers_connected=99,
    window_wall_s=20.0,
    window_sim_s=20.0,
    messages_per_wall_s=305.2,
    messages_per_sim_s=305.2,
    deliveries_per_wall_s=400.0,
    lost_share=0.0,
    lost_before=7.0,
    cpu_ms_per_message=0.5,
    cores={"DroneFactory": 0.4, "rosout": 0.001},
    links=342,
    cpu_ms_per_sim_s_and_link=1.25,
    pss_mb=200.0,
    rss_mb=300.0,
    threads=50,
    open_files=90,
    reached_real_time_factor=1.0,
    worst_timer_lag_s=0.012,
)


def test_the_name_of_a_flying_fleet_says_that_it_flies() -> None:
    assert "100, 97 flying" in ros_tables([replace(RESULT, flying=97)])
    assert "flying" not in ros_tables([RESULT])


def rows(text):
    """Cells of each row of each table."""
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("|") and "--" not in line
    ]


def test_a_table_is_markdown_with_columns_of_one_width():
    assert table(("a", "long"), [("100", "x")]) == (
        "|   a | long |\n| --- | ---- |\n| 100 |    x |"
    )


def test_each_fleet_has_a_row_in_each_table():
    start, traffic, cost = rows(ros_tables([RESULT]))[1::2]
    assert start == ["100", "6 m", "1", "8.2", "1.5", "1.6"]
    assert traffic == ["100", "6 m", "1", "305", "400", "0.000%", "7", "1.00", "12 ms"]
    assert cost == ["100", "6 m", "1", "0.40", "0.40", "0.50", "342", "1.25", "200", "300"]


def test_what_is_not_known_is_a_dash_and_a_fleet_that_never_met_says_how_far_it_came():
    result = replace(
        RESULT,
        connected_after_sim_s=None,
        connected_after_wall_s=None,
        routers_connected=46,
        deliveries_per_wall_s=None,
        lost_share=None,
        lost_before=None,
        worst_timer_lag_s=None,
        cpu_ms_per_message=None,
    )
    start, traffic, cost = rows(ros_tables([result]))[1::2]
    assert start[4:] == ["never (46 of 99)", "-"]
    assert traffic[4:] == ["-", "-", "-", "1.00", "-"]
    assert cost[5] == "-"


def test_processes_of_different_fleets_share_their_columns():
    other = replace(RESULT, cores={"mesh_host_2": 0.3})
    heading, first, second = rows(ros_tables([RESULT, other]))[-3:]
    assert heading[3:6] == ["DroneFactory", "mesh_host_2", "all"]
    assert first[3:6] == ["0.40", "-", "0.40"]
    assert second[3:6] == ["-", "0.30", "0.30"]


def test_the_in_process_table_gives_processor_time_and_wall_time():
    result = InProcessResult(
        drones=25,
        spacing_m=6.0,
        runs=5,
        simulated_s=60.0,
        from_start_per_cpu_s=1500.4,
        from_start_per_wall_s=1400.0,
        from_start_best_per_cpu_s=1550.0,
        running_per_cpu_s=1700.0,
        running_per_wall_s=1600.0,
        running_best_per_cpu_s=1750.0,
        packets_per_cpu_s=90000.4,
        packets=6280,
        all_connected=True,
    )
    row = rows(inprocess_table([result]))[1]
    assert row == ["25", "6 m", "1500 (1400)", "1550", "1700 (1600)", "1750", "90000", "yes"]
