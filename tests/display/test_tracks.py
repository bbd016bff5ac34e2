"""``tracks.png`` and ``consistency.png``: what a tracker confirmed, and how honest it is."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection, QuadMesh
from scipy.stats import chi2

import dsa_des
from components.display.consistency import draw_consistency, nees_of_nearest_target
from components.display.outcomes import distances_to_targets
from components.display.tracks import DrawnTracks, draw_tracks
from components.messages.state_tracks import COVARIANCE
from dsa_des.running.simulation import Simulation

EKF = "blocks.tracker.type='tracking.ekf'"


def near(*sets):
    every = ["duration_s=3", "blocks.fusion.type='fusion.pass_through'",
             "blocks.traffic.intruders.0.north_m=3000", *sets]  # fmt: skip
    last = {one.partition("=")[0]: one for one in every}  # --set gives no key twice
    return dsa_des.load_scene("first_light", sets=[*last.values()])


def told(tmp_path, *sets):
    scene = near(*sets)
    dsa_des.run(scene, out=tmp_path / "run")
    return DrawnTracks.read(Simulation(scene), tmp_path / "run")


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    return told(tmp_path_factory.mktemp("shown"), EKF)


@pytest.mark.parametrize("draw", [draw_tracks, draw_consistency])
def test_confirmed_tracks_are_drawn_the_same_every_time(tmp_path, draw, shown):
    paths = [draw(tmp_path / name, shown) for name in ("one.png", "two.png")]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert paths[0].read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize("sets", [(), (EKF, "blocks.tracker.confirm_m=60",
                                       "blocks.tracker.confirm_n=62", "duration_s=1")])  # fmt: skip
def test_where_nothing_is_confirmed_there_is_no_figure(tmp_path, sets):
    assert told(tmp_path, *sets) is None


def test_tracks_are_false_that_never_come_near_a_target(tmp_path, shown):
    """A bias of 900 m puts every track beside its target."""
    stated = [
        f"blocks.radar.{key}"
        for key in (
            "errors='stated'",
            "azimuth_error_deg=0.1",
            "elevation_error_deg=0.1",
            "range_error_m=5",
            "biases='fixed'",
            "range_bias_m=900",
        )
    ]
    wrong = told(tmp_path, EKF, *stated)
    assert wrong.tracks and all(one.false for one in wrong.tracks)
    assert draw_consistency(tmp_path / "none.png", wrong) is None
    draw_tracks(tmp_path / "false.png", wrong)
    assert shown.tracks and not any(one.false for one in shown.tracks)


def drawn_figure(monkeypatch, draw, path, drawn):
    """The figure that is drawn, before it is a picture."""
    found = []
    monkeypatch.setattr(
        FigureCanvasAgg, "print_png", lambda canvas, *_, **__: found.append(canvas.figure)
    )
    draw(path, drawn)
    return found[0]


def test_compared_trackers_have_their_own_means(tmp_path, monkeypatch, shown):
    """Two trackers, of which one is twice as sure of itself as it ought to be: not pooled."""
    two = copy(shown)
    sure = {name: shown.tracks[0].columns[name] / 4.0 for name in COVARIANCE.values()}
    two.blocks = ["honest", "sure"]
    two.tracks = [
        replace(shown.tracks[0], block="honest"),
        replace(shown.tracks[0], block="sure", columns=shown.tracks[0].columns | sure),
    ]
    two.seen_by = dict.fromkeys(two.blocks, shown.seen_by[shown.tracks[0].block])
    figure = drawn_figure(monkeypatch, draw_consistency, tmp_path / "x.png", two)
    errors, innovations = figure.axes
    assert "mean" not in errors.get_title(loc="left") + innovations.get_title(loc="left")
    columns = shown.tracks[0].columns
    found, known = nees_of_nearest_target(columns, two.targets.states(columns["state_s"]))
    assert known.all()
    low, high = chi2.ppf([0.025, 0.975], 6)
    words = [text.get_text() for text in errors.get_legend().get_texts()]
    for word, block, values in zip(words, two.blocks, (found, 4.0 * found), strict=True):
        share = 100.0 * np.mean((values >= low) & (values <= high))
        assert word == f"{block}: {values.mean():.3g}, {share:.0f} % inside"
    assert [text.get_text()[:4] for text in innovations.get_legend().get_texts()] == [
        "hone", "sure"]  # fmt: skip


def test_tracks_of_whatever_numbers_have_colours_of_their_own(shown):
    """Numbers 2 and 8 once had the same of six colours."""
    one = shown.tracks[0]
    columns = {name: np.concatenate([values] * 2) for name, values in one.columns.items()}
    columns["track"] = np.repeat([2, 8], len(one.columns["state_s"]))
    columns["block"] = np.array(["tracker"] * len(columns["track"]))
    origin = {
        f"origin_{name}": np.full(len(columns["track"]), value)
        for name, value in zip(("lat_deg", "lon_deg", "alt_m"), shown.origin, strict=True)
    }
    drawn = DrawnTracks(Simulation(near()), columns | origin)
    assert [track.number for track in drawn.tracks] == [2, 8]
    assert len({track.colour for track in drawn.tracks}) == 2


@pytest.mark.parametrize("many", [40, 60])
def test_of_many_tracks_their_median_is_drawn(tmp_path, monkeypatch, shown, many):
    """Sixty lines would cover each other: at each time half of the tracks are below the middle."""
    crowd, one = copy(shown), shown.tracks[0]
    scales = np.geomspace(0.1, 10.0, many)
    crowd.tracks = [
        replace(
            one,
            number=number,
            columns=one.columns | {name: one.columns[name] / k for name in COVARIANCE.values()},
        )
        for number, k in enumerate(scales.tolist())
    ]
    figure = drawn_figure(monkeypatch, draw_consistency, tmp_path / "x.png", crowd)
    errors = figure.axes[0]
    drawn = [line for line in errors.lines if len(line.get_xdata()) > 2]
    if many == 40:
        assert len(drawn) == many
        return
    (median,) = drawn
    (spread,) = (band for band in errors.collections if len(band.get_paths()[0].vertices) > 20)
    found, _ = nees_of_nearest_target(one.columns, shown.targets.states(one.columns["state_s"]))
    assert found.min() - 1e-9 < median.get_ydata().min() < median.get_ydata().max() < found.max()
    top = spread.get_paths()[0].vertices[:, 1].max()
    assert top / found.max() == pytest.approx(np.quantile(scales, 0.975), rel=0.3)
    words = [text.get_text() for text in errors.get_legend().get_texts()]
    assert words == ["95 % of 60 tracks", "median"]


@pytest.mark.parametrize("many", [3, 100])
def test_of_many_aircraft_the_density_is_drawn(tmp_path, monkeypatch, shown, many):
    """And of many tracks no spreads, which would cover each other."""
    crowd = copy(shown)
    crowd.tracks = [shown.tracks[0]] * many
    at, names = shown.targets.positions_at, shown.targets.names

    class Copies:
        def __getattr__(self, name):
            return getattr(shown.targets, name)

        def positions_at(self, time_s):
            rows = at(time_s)
            shift = 20.0 * np.arange(many)[:, np.newaxis, np.newaxis]
            return np.resize(rows[0], (many, *rows.shape[1:])) + shift

    crowd.targets = Copies()
    crowd.targets.names = names * many
    figure = drawn_figure(monkeypatch, draw_tracks, tmp_path / "x.png", crowd)
    for axes in figure.axes:
        meshes = [one for one in axes.collections if isinstance(one, QuadMesh)]
        assert len(meshes) == (many >= 100)
        truth = [one for one in axes.lines if one.get_color() == "#000000"]
        assert {one.get_alpha() for one in truth} == {0.0 if meshes else 1.0}
    assert bool(figure.axes[0].patches) == (many < 100)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert ("truth (darker: more)" in words) == (many >= 100) == ("95 %" not in words)


@pytest.mark.parametrize("still", [True, False])
def test_a_target_that_stays_where_it_is_is_a_dot(tmp_path, monkeypatch, shown, still):
    drawn = copy(shown)

    class Posts:
        def __getattr__(self, name):
            return getattr(shown.targets, name)

        def positions_at(self, time_s):
            places = shown.targets.positions_at(time_s)
            return np.repeat(places[:, :, :1], len(time_s), axis=2) if still else places

    drawn.targets = Posts()
    plan = drawn_figure(monkeypatch, draw_tracks, tmp_path / "x.png", drawn).axes[0]
    dots = [one.get_offsets()[0] for one in plan.collections if isinstance(one, PathCollection)]
    if still:
        places = shown.targets.positions_at(np.array([drawn.time_s[0]]))[:, :, 0]
        np.testing.assert_allclose(dots, places[:, [1, 0]] / 1e3)
    else:
        assert dots == []


def one_track(rng):
    columns = {name: rng.normal(size=4) for name in ("north_m", "east_m", "down_m", "north_m_s",
                                                     "east_m_s", "down_m_s")}  # fmt: skip
    root = rng.normal(size=(4, 6, 6))
    spread = root @ root.swapaxes(1, 2) + np.eye(6)
    columns |= {name: spread[:, i, j] for (i, j), name in COVARIANCE.items()}
    return {**columns, "state_s": np.arange(4.0)}, spread


def test_errors_are_those_to_the_nearest_target_at_the_same_time():
    rng = np.random.default_rng(2)
    columns, spread = one_track(rng)
    states = rng.normal(size=(3, 6, 4)) * 5.0
    states[0, :3] += 1e4  # far away all the time
    states[1, :, 2] = states[2, :, 2] = np.nan  # and at one instant nobody is near
    found, known = nees_of_nearest_target(columns, states)
    assert known.tolist() == [True, True, False, True] and np.isnan(found[2])
    estimate = np.array([columns[name] for name in list(columns)[:6]])
    for row in (0, 1, 3):
        apart = [np.linalg.norm(estimate[:3, row] - states[t, :3, row]) for t in range(3)]
        error = estimate[:, row] - states[int(np.argmin(apart)), :, row]
        assert found[row] == pytest.approx(error @ np.linalg.inv(spread[row]) @ error)
    np.testing.assert_allclose(distances_to_targets(columns, slice(None), states[:, :3])[:, 0], [
        np.linalg.norm(estimate[:3, 0] - states[t, :3, 0]) for t in range(3)])  # fmt: skip
    assert not nees_of_nearest_target(columns, np.empty((0, 6, 4)))[1].any()
