"""The benchmark runs, also where fluidsim is missing."""

import pytest

from gbm_plugin.studies.bench import spectral


@pytest.mark.exhaustive  # it compiles transforms by themselves
def test_benchmark_at_a_small_size():
    result = spectral.run(cells=16, repeats=2)
    for precision in ("double", "single"):
        assert result[precision]["transform_share"] > 0
        assert result[precision]["time"] > 0
    # velocity and three slopes alone: 4 * 3 fields of (2K+1)^2 (K+1) complex numbers, K = 5
    assert result["double"]["bytes_per_point"] > 12 * 11 * 11 * 6 * 16 / 16**3
    assert result["double"]["bytes_per_point"] > result["single"]["bytes_per_point"]
    text = spectral.table(result)
    assert ("fluidsim was not found" in text) == (result["fluidsim"] is None)
    if result["fluidsim"]:
        assert result["double"]["times_faster_than_fluidsim"] == pytest.approx(
            result["fluidsim_time"] / result["double"]["time"]
        )
