"""What counts as growing in a long run."""

from drone_mesh.bench.soak import Sample, judge


def samples(
    memory_mb, minutes=60, threads=lambda minute: 40, files=lambda minute: 90, minute_wall_s=10.0
):
    return [
        Sample(
            sim_s=60.0 * minute,
            wall_s=4.0 + minute_wall_s * minute,
            pss_mb=0.0,
            rss_mb=memory_mb(minute),
            threads=threads(minute) + 3,
            open_files=files(minute) + 5,
            routers_connected=99,
            threads_of={"world": threads(minute), "master": 3},
            open_files_of={"world": files(minute), "master": 5},
        )
        for minute in range(minutes + 1)
    ]


def test_what_grows_in_the_first_ten_minutes_only_does_not_count():
    verdict = judge(
        samples(lambda minute: 100.0 + 5.0 * min(minute, 9), threads=lambda m: 40 + (m < 10))
    )
    assert verdict.steady
    assert verdict.memory_before_mb == verdict.memory_after_mb == 145.0
    assert verdict.threads == (43, 43)
    assert verdict.changed == ()


def test_memory_that_keeps_growing_is_noticed():
    verdict = judge(samples(lambda minute: 100.0 + 0.2 * minute))
    assert verdict.memory_grew
    assert not verdict.steady


def test_memory_may_rise_and_fall():
    assert not judge(samples(lambda minute: 100.0 + (minute % 2))).memory_grew


def test_one_more_connection_is_noticed():
    verdict = judge(samples(lambda minute: 100.0, files=lambda minute: 90 + (minute > 55)))
    assert verdict.open_files == (95, 96)
    assert verdict.changed == ("world",)
    assert not verdict.steady


def test_idle_connections_of_the_start_may_go_in_the_first_minute_and_a_half_of_the_wall():
    fast = samples(lambda m: 100.0, files=lambda m: 90 + (m < 30), minute_wall_s=3.0)
    assert judge(fast).steady
    late = samples(lambda m: 100.0, files=lambda m: 90 + (m < 31), minute_wall_s=3.0)
    assert judge(late).open_files == (95, 96)


def test_a_run_that_was_too_short_has_no_verdict():
    assert judge(samples(lambda minute: 100.0, minutes=11)) is None
    assert judge(samples(lambda minute: 100.0, minute_wall_s=1.0)) is None
    assert judge(samples(lambda minute: 100.0, minute_wall_s=1.52)) is None  # one sample
    assert judge(samples(lambda minute: 100.0, minute_wall_s=1.6)) is not None
