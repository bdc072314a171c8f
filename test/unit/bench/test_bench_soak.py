"""What counts as growing in a long run."""

from drone_mesh.bench.soak import Sample, judge


def samples(memory_mb, minutes=60, threads=lambda minute: 40, files=lambda minute: 90):
    return [
        Sample(60.0 * minute, 0.0, 0.0, memory_mb(minute), threads(minute), files(minute), 99)
        for minute in range(minutes + 1)
    ]


def test_what_grows_in_the_first_ten_minutes_only_does_not_count():
    verdict = judge(
        samples(lambda minute: 100.0 + 5.0 * min(minute, 9), threads=lambda m: 40 + (m < 10))
    )
    assert verdict.steady
    assert verdict.memory_before_mb == verdict.memory_after_mb == 145.0
    assert verdict.threads == (40, 40)


def test_memory_that_keeps_growing_is_noticed():
    verdict = judge(samples(lambda minute: 100.0 + 0.2 * minute))
    assert verdict.memory_grew
    assert not verdict.steady


def test_memory_may_breathe():
    assert not judge(samples(lambda minute: 100.0 + (minute % 2))).memory_grew


def test_one_connection_more_is_noticed():
    verdict = judge(samples(lambda minute: 100.0, files=lambda minute: 90 + (minute > 55)))
    assert verdict.open_files == (90, 91)
    assert not verdict.steady


def test_a_run_that_was_too_short_has_no_verdict():
    assert judge(samples(lambda minute: 100.0, minutes=11)) is None
