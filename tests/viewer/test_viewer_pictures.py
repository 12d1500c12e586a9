"""What a person sees: the real viewer draws blades that turn, and the plots beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from viewer_example import ROTOR_SPEED, write
from viewer_pictures import near, part, screen, warm

from fatigue_runner.viewer import colours

pytestmark = pytest.mark.slow(reason="the viewer draws every picture without a graphics card")
pytest.importorskip("rerun", reason="rerun-sdk is not installed")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    logs = tmp_path_factory.mktemp("run") / "logs"
    for method in ("dop853", "rk3", "heun"):
        write(logs, method)
    return logs.parent


@pytest.fixture(scope="module")
def one(folder, tmp_path_factory) -> Path:
    return saved(folder / "logs" / "u10_rk3_20ms.mcap", tmp_path_factory.mktemp("one") / "one.rrd")


def saved(what: Path, target: Path) -> Path:
    from fatigue_runner.viewer.cases import find_logs, read_cases
    from fatigue_runner.viewer.window import write_recording

    write_recording(target, read_cases(find_logs([what])), playing=False)
    return target


def test_first_screen_shows_turning_blades_a_tower_and_plots(one):
    third_of_a_turn = 2 * np.pi / 3 / ROTOR_SPEED
    with screen(one) as viewer:
        start, later, again = (viewer.at(t) for t in (3.0, 3.0 + third_of_a_turn / 2, 3.0 + third_of_a_turn))
    scene = (0.15, 0.59, 0.1, 0.68)
    blades = warm(part(start, *scene))
    assert blades.sum() > 2200, "the blades are coloured by their flap moment"
    moved = warm(part(later, *scene))
    assert (blades & moved).sum() < 0.35 * blades.sum(), "half a blade distance later they are elsewhere"
    back = warm(part(again, *scene))
    assert (blades & back).sum() > 2 * (blades & moved).sum(), (
        "a third of a turn later each is in another's place"
    )
    tower = part(start, 0.29, 0.35, 0.42, 0.56)
    grey = (np.ptp(tower.astype(int), axis=-1) < 12) & (tower.max(axis=-1) > 150)
    assert grey.any(axis=1).mean() > 0.9, "the tower stands under them"
    disc = part(start, *scene).astype(int)
    assert ((disc[..., 2] > disc[..., 0] + 40) & (disc[..., 2] > 90)).sum() > 20000, "the wind is behind them"
    plots, winds = part(start, 0.61, 0.99), part(start, 0.02, 0.5, 0.8, 0.96)
    for colour in colours.BLADES:
        assert near(plots, colour).sum() > 300, "each blade has its curve"
        assert near(winds, colour).sum() > 300, "and below the scene that of its own wind"
        assert near(part(start, *scene), colour, 15).sum() > 30, (
            "which an arrow and a number show at the blade"
        )


def test_band_is_green_where_the_network_was_trusted_and_red_where_not(one):
    with screen(one) as viewer:
        picture = viewer.at(5.0)
    band = part(picture, 0.61, 0.99, 0.56, 0.585)
    # the viewer darkens the colours behind the words
    green, red = (
        near(band, tuple(int(0.78 * c) for c in colour), 30)
        for colour in (colours.ACCEPTED, colours.REJECTED)
    )
    assert green.any(axis=0).sum() > 1.6 * red.any(axis=0).sum(), "two thirds of the steps were trusted"
    assert red.any(axis=0).sum() > 80
    # the last third of the log fell back: red lies to the right of green
    assert np.median(np.flatnonzero(red.any(axis=0))) > np.median(np.flatnonzero(green.any(axis=0)))


def test_first_screen_shows_discrepancy_against_threshold_and_the_error_against_the_reference(one):
    with screen(one) as viewer:
        picture = viewer.at(5.0)
    margin, error = part(picture, 0.61, 0.94, 0.645, 0.785), part(picture, 0.61, 0.94, 0.82, 0.965)
    assert near(margin, colours.REJECTED).any(axis=0).mean() > 0.9, "the threshold is a line all along"
    assert near(margin, colours.INTEGRATORS[0]).any(axis=0).mean() > 0.9, "so is the discrepancy"
    assert near(error, colours.INTEGRATORS[0]).any(axis=0).mean() > 0.9


def test_integrators_of_one_wind_stand_side_by_side(folder, tmp_path):
    with screen(saved(folder, tmp_path / "all.rrd")) as viewer:
        picture = viewer.at(3.0)
    scene = part(picture, 0.15, 1.0, 0.08, 0.46)
    columns = np.flatnonzero(warm(scene).sum(axis=0) > 0)
    gaps = np.flatnonzero(np.diff(columns) > 15)
    assert len(gaps) + 1 >= 3, "three rotors with air between them"
    error = part(picture, 0.0, 0.5, 0.74, 0.96)
    # both lie on each other
    assert near(error, colours.INTEGRATORS[1], 70).sum() > 200
