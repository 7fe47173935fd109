"""The companions of the study of buckling: sensitivity, shapes, transport."""

import numpy as np
import pytest

from gbm_plugin.studies.paper import buckling_sensitivity, buckling_shapes, buckling_transport
from gbm_plugin.studies.taylor_green import Scene


def test_the_torque_as_printed_shifts_the_curve_by_two_exactly(tmp_path):
    """γ as printed with K is γ consistent with 2K: the same fibers at 2 Sp, event by event, with as many sub-steps."""
    names = ["torque as printed", "torque as printed, 2 Sp"]
    result = buckling_sensitivity.run(
        sp=(450.0, 1e4), count=30, end=12.0, only=names, workers=1, state=tmp_path
    )
    of = {name: [r for r in result["rows"] if r["variation"] == name] for name in ("default", *names)}
    for default, shifted in zip(of["default"], of[names[1]], strict=True):
        assert (default["tracks"], default["events"]) == (shifted["tracks"], shifted["events"])
    assert of["default"][1]["events"] > 0
    (summary,) = [s for s in result["summary"] if s["variation"] == names[1]]
    assert summary["largest_difference"] == 0 and not summary["moves"]
    # normalised by 2aN a straight fiber is at 0.83: nearer the criterion, so that more of them fall below it
    shorter = [r for r in result["rows"] if r["variation"] == "normalised by 2aN"]
    assert shorter[1]["probability"] > of["default"][1]["probability"]
    assert "moves?" in buckling_sensitivity.table(result)
    buckling_sensitivity.draw(result)


def test_every_variation_is_a_scene_of_its_own():
    default = Scene(450.0)
    scenes = [buckling_sensitivity.varied(default, name) for name in buckling_sensitivity.VARIATIONS]
    assert len({scene.file for scene in [default, *scenes]}) == len(scenes) + 1


def test_shapes_of_a_short_run(tmp_path):
    result = buckling_shapes.run(sp=(450.0, 1e5), count=40, end=12.0, workers=1, state=tmp_path)
    for row in result["rows"]:
        assert row["events"] > 0
        assert sum(row[name] for name in buckling_shapes.SHAPES) == pytest.approx(1)
    buckling_shapes.draw(result)


def test_tracers_stay_in_their_cells():
    scene = Scene(1.0, count=60)
    paths = buckling_transport._tracers(scene, 60.0)
    start = scene.positions(60, np.random.default_rng(1)).mean(axis=1)[:, :2]
    inside = np.abs(start - np.floor(start) - 0.5).max(axis=1) < 0.49  # a separatrix takes for ever to follow
    np.testing.assert_array_equal(
        np.floor(paths[:, inside]), np.broadcast_to(np.floor(start[inside]), (60, inside.sum(), 2))
    )
    stream = np.sin(np.pi * paths[..., 0]) * np.sin(np.pi * paths[..., 1])
    np.testing.assert_allclose(stream[-1], np.prod(np.sin(np.pi * start), axis=1), atol=1e-4)


def test_last_crossing():
    paths = np.zeros((6, 2, 2)) + 0.5
    paths[3:, 0, 0] = 1.5
    np.testing.assert_array_equal(buckling_transport._last_crossing(paths), [4.0, 0.0])


def test_too_short_for_transport():
    with pytest.raises(ValueError, match="at least 400"):
        buckling_transport.run(end=100.0)
