"""The drawn turbine stands, turns and bends as the equations of motion say; no viewer is needed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from viewer_example import motion, shape

from fatigue_runner.errors import InputError
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.viewer import colours, shapes

SPAN = np.linspace(1.5, 63.0, 400)


def state(**values: float) -> np.ndarray:
    """One state (1, 16), zero but for: a, s, f1, f2, f3, e, azimuth."""
    order = ("a", "s", "f1", "f2", "f3", "e", "azimuth")
    out = np.zeros((1, 16))
    for name, value in values.items():
        out[0, order.index(name)] = value
    return out


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(*(st.floats(-1, 1) for _ in range(6))),
    st.floats(-10, 10),
)
def test_bent_blades_keep_their_length_to_second_order(q, azimuth):
    x = np.zeros((1, 16))
    x[0, :6], x[0, 6] = np.array(q) * [1, 1, 6, 6, 6, 1], azimuth
    blades = shape().pose(x, SPAN).blades[0]
    lengths = np.linalg.norm(np.diff(blades, axis=1), axis=-1).sum(axis=1)
    # first order would be 0.6 m at 6 m of flap; what is left is of fourth order in the slope
    assert lengths == pytest.approx(61.5, abs=0.02)


def test_blade_tips_are_where_the_log_s_channels_say_in_coned_axes():
    from fatigue_runner.turbine import load_turbine

    trajectory = motion(50)
    loads = load_turbine("nrel5mw").loads(trajectory.state, trajectory.wind)
    geometry = shape()
    pose = geometry.pose(trajectory.state, np.array([63.0]))
    arm = pose.blades[:, :, 0] - pose.apex[:, None]
    in_coned_axes = np.einsum("nbij,nbi->nbj", pose.coned, arm)
    for i in range(3):
        assert in_coned_axes[:, i, 0] == pytest.approx(loads[f"blade{i + 1}_tip_out_of_plane"], abs=1e-9)
        assert in_coned_axes[:, i, 1] == pytest.approx(loads[f"blade{i + 1}_tip_in_plane"], abs=1e-9)


def test_tip_channels_turn_with_the_pitch():
    from fatigue_runner.turbine import load_turbine

    trajectory, pitch = motion(5), 0.2
    loads = load_turbine("nrel5mw").loads(trajectory.state, trajectory.wind, pitch)
    drawn = shape(pitch=pitch).tip_channels(trajectory.state)
    assert drawn[:, 1, 0] == pytest.approx(loads["blade2_tip_out_of_plane"], abs=1e-9)
    assert drawn[:, 1, 1] == pytest.approx(loads["blade2_tip_in_plane"], abs=1e-9)


def test_rotor_turns_clockwise_for_who_stands_upwind_and_looks_downwind():
    tip = np.array([63.0])
    for name in ("nrel5mw", "t2b1i1cg"):
        geometry = shape(name)
        up, later = (geometry.pose(state(azimuth=angle), tip).blades[0, 0, 0] for angle in (0.0, 0.3))
        assert up[1] == pytest.approx(0.0, abs=1e-12) and up[2] > geometry.hub_height + 60
        assert later[1] < -15  # y is to the left of who looks downwind, so this is to the right


def test_blades_follow_each_other_by_120_degrees():
    tip = np.array([63.0])
    pose = shape().pose(state(azimuth=0.4), tip)
    ahead = shape().pose(state(azimuth=0.4 + 2 * np.pi / 3), tip)
    assert ahead.blades[0, 0] == pytest.approx(pose.blades[0, 1], abs=1e-9)


def test_tower_top_is_at_the_tower_states_and_the_foot_stays():
    pose = shape().pose(state(a=0.7, s=-0.3), SPAN)
    assert pose.top[0, :2] == pytest.approx([0.7, -0.3], abs=1e-4)  # the report's modes are 0.9999 at the top
    assert pose.tower[0, 0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    parameters = shape().tower
    drop = (parameters.fore_aft.shortening_top * 0.7**2 + parameters.side_side.shortening_top * 0.3**2) / 2
    assert pose.top[0, 2] == pytest.approx(87.6 - drop, abs=1e-6)


def test_nacelle_nods_downwind_with_the_tower_and_rolls_to_its_side():
    pose = shape().pose(state(a=0.7, s=0.4), SPAN)
    up = pose.nacelle[0, :, 2]
    tower = shape().tower
    assert up[0] == pytest.approx(np.sin(0.7 * tower.fore_aft.top_slope), rel=1e-3)
    assert up[1] == pytest.approx(np.sin(0.4 * tower.side_side.top_slope), rel=1e-3)


def test_upwind_rotor_stands_before_the_tower_tilted_up_with_its_tips_upwind():
    geometry = shape()
    pose = geometry.pose(state(), np.array([63.0]))
    assert pose.apex[0, 0] == pytest.approx(-5.0191 * np.cos(np.radians(5)), abs=1e-9)
    # NREL/TP-500-38060: the hub is 90 m above the ground
    assert pose.apex[0, 2] == pytest.approx(90.0, abs=0.01)
    axis = pose.rotor[0, :, 0]
    assert axis == pytest.approx([np.cos(np.radians(5)), 0, -np.sin(np.radians(5))], abs=1e-12)
    # in the plane through the apex normal to the shaft the tips stand 63 m sin(2.5 deg) upwind
    out = (pose.blades[0, :, 0] - pose.apex[0]) @ axis
    assert out == pytest.approx(np.full(3, -63.0 * np.sin(np.radians(2.5))), abs=1e-9)


def test_scale_multiplies_deflections_and_keeps_lengths():
    x = motion(3).state
    one, three = shape().pose(x, SPAN), shape().pose(x, SPAN, scale=3.0)
    assert three.top[:, :2] == pytest.approx(3 * one.top[:, :2])
    true, large = shape().deflection(x, SPAN), shape().deflection(x, SPAN, 3.0)
    assert large[..., :2] == pytest.approx(3 * true[..., :2])
    assert large[..., 2] == pytest.approx(9 * true[..., 2])


def test_straight_pitch_axes_are_the_blades_of_an_undeflected_turbine():
    geometry = shape()
    pose = geometry.pose(state(azimuth=1.1), np.array([1.5, 63.0]))
    drawn = pose.apex[0] + geometry.straight_blades() @ pose.rotor[0].T
    assert drawn == pytest.approx(pose.blades[0], abs=1e-9)


def test_states_of_another_shape_are_refused():
    with pytest.raises(InputError, match=r"\(n, 16 or more\), got \(16,\)"):
        shape().pose(np.zeros(16), SPAN)


def test_blade_skin_has_the_turbine_file_s_chord_across_the_pitch_axis():
    data = read_turbine_file("nrel5mw")
    skin = shapes.blade_skin(data, shape())
    station = int(
        np.argmin(np.abs(skin.radius - 32.25))
    )  # 30.75 m from the root: chord 3.748 m, twist 6.544 deg
    chord = skin.outline[station, 3] - skin.outline[station, 0]  # leading to trailing edge
    expected = np.interp(skin.radius[station] - 1.5, [26.65, 30.75, 34.85], [4.007, 3.748, 3.502])
    assert np.linalg.norm(chord) == pytest.approx(expected, rel=1e-3)
    assert chord[0] > 0  # twist to feather turns the leading edge upwind, so the trailing edge lies downwind


def test_blades_turn_about_their_span_with_the_pitch_of_the_log():
    """A quarter of a turn to feather: the chord, which lies across the wind at the tip, points downwind."""
    skin = shapes.blade_skin(read_turbine_file("nrel5mw"), shape())
    fine, feathered = (
        skin.vertices(shape().pose(state(), skin.radius, pitch=np.array([angle])))[0, 0].reshape(
            len(skin.radius), -1, 3
        )
        for angle in (0.0, np.pi / 2)
    )
    chords = [blade[-3, 3] - blade[-3, 0] for blade in (fine, feathered)]
    assert abs(chords[0][0]) < 0.15 * np.linalg.norm(chords[0]) and chords[1][0] > 0.95 * np.linalg.norm(
        chords[1]
    )
    assert np.allclose(fine.mean(axis=1)[-3], feathered.mean(axis=1)[-3], atol=0.5)


def test_tips_of_a_run_under_control_are_where_its_log_says(nrel5mw):
    from fatigue_runner import simulate

    run = simulate(nrel5mw, 17.0, "rk4", 0.05, 2.0, operation="controlled")
    drawn = shape().tip_channels(run.state, run.pitch)
    assert np.degrees(run.pitch.min()) > 10
    for i in (1, 2, 3):
        assert drawn[:, i - 1, 0] == pytest.approx(run.loads[f"blade{i}_tip_out_of_plane"], abs=1e-6)
        assert drawn[:, i - 1, 1] == pytest.approx(run.loads[f"blade{i}_tip_in_plane"], abs=1e-6)


def test_skins_are_closed_to_the_last_ring_and_use_every_vertex():
    for vertices, triangles in (shapes.hub_skin(shape()), shapes.nacelle_skin(shape())):
        assert set(triangles.ravel()) == set(range(len(vertices)))
        assert np.isfinite(vertices).all()


def test_colour_scales_end_at_their_ends_and_show_the_unknown_in_grey():
    low, high, over, unknown = colours.on_scale([0.0, 1.0, 7.0, np.nan], 0.0, 1.0, colours.FLAP_SCALE)
    assert tuple(low[:3]) == colours.FLAP_SCALE[0]
    assert tuple(high[:3]) == tuple(over[:3]) == colours.FLAP_SCALE[-1]
    assert tuple(unknown[:3]) == (120, 120, 120)
    assert colours.packed(np.array([[1, 2, 3, 4]], np.uint8))[0] == 0x01020304


def test_light_rises_along_both_scales():
    for scale in (colours.FLAP_SCALE, colours.WIND_SCALE):
        light = [0.2126 * r + 0.7152 * g + 0.0722 * b for r, g, b in scale]
        assert light == sorted(light)


def test_normals_of_a_surface_of_revolution_point_away_from_its_axis():
    x = np.linspace(0.0, 4.0, 5)
    vertices, triangles = shapes.revolved(x, np.full(5, 2.0), sides=24)
    normal = shapes.normals(vertices[None], triangles)[0]
    middle = slice(24, 72)  # the rings that are not at an end
    outwards = vertices[middle] * [0.0, 0.5, 0.5]
    assert np.einsum("ij,ij->i", normal[middle], outwards) == pytest.approx(1.0, abs=0.02)


def test_skins_of_blades_and_tower_face_outwards_so_that_light_falls_on_them():
    skin = shapes.blade_skin(read_turbine_file("nrel5mw"), shape())
    pose = shape().pose(state(), skin.radius)
    for vertices, triangles, sides in (
        (skin.vertices(pose)[:, 0], skin.triangles(), skin.outline.shape[1]),
        (shapes.tower_vertices(pose), shapes.tower_triangles(9), 10),
    ):
        middle = vertices[0].reshape(-1, sides, 3).mean(axis=1).repeat(sides, axis=0)
        outwards = np.einsum("ij,ij->i", vertices[0] - middle, shapes.normals(vertices, triangles)[0])
        assert (outwards > 0).all()
