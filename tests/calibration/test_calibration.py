"""A correction learned from another program's series: what is known comes out, what is not is said, and what is wrong is refused."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from places import SHARED
from typer.testing import CliRunner

from fatigue_runner.calibration.calibration import Calibration, calibrate
from fatigue_runner.calibration.commands import app
from fatigue_runner.calibration.fit import Block, Form, fit, loads, shaped
from fatigue_runner.calibration.series import read_series
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.checked_json import to_checked
from fatigue_runner.logbook import read_log

EXPONENTS = (3.0, 4.0, 10.0)
FLAP, EDGE = "blade1_root_flapwise_moment", "blade1_root_edgewise_moment"
OPENFAST = SHARED / "openfast_operation"


def load(rng, seconds=300.0, dt=0.05):
    """Slow and fast parts of a load, as turbulence and rotation make them."""
    t = np.arange(round(seconds / dt)) * dt
    slow = np.cumsum(rng.standard_normal(len(t))) * dt
    return 1e6 * (
        5
        + 0.3 * (slow - slow.mean())
        + 0.5 * np.sin(1.2 * t + rng.uniform(0, 6))
        + 0.1 * rng.standard_normal(len(t))
    )


def richer(x, factor, power, shift=0.0):
    d, s = x - x.mean(), x.std()
    return x.mean() + shift + factor * shaped(d, s, power)


def blocks_of(factor_at, power, noise=0.0, winds=(6.0, 10.0, 14.0, 18.0), per_wind=2):
    """Theirs is not in phase with ours: it runs backwards, and is corrected by what is known."""
    out, rng = [], np.random.Generator(np.random.PCG64(7))
    for wind in winds:
        for _ in range(per_wind):
            x = load(rng)
            factor = factor_at(wind) * np.exp(noise * rng.standard_normal())
            out.append(Block(f"v{wind}", wind, 300.0, x, richer(x, factor, power, 2e5)[::-1]))
    return out


def test_a_factor_that_grows_with_the_wind_is_found_and_its_shift():
    found = fit(blocks_of(lambda v: np.exp(0.01 * v), 1.0), EXPONENTS)
    assert found.correction.form == Form(1, False)
    for wind in (6.0, 12.0, 18.0):
        a, g, p = found.correction.at(wind)
        assert np.exp(g) == pytest.approx(np.exp(0.01 * wind), rel=0.005) and p == 1.0
        assert a == pytest.approx(2e5, rel=1e-6)
    assert found.tried[Form(1, False)] < 0.01 < 0.05 < found.tried[Form(-1, False)]


def test_large_ranges_that_are_larger_than_small_ones_are_found():
    found = fit(blocks_of(lambda v: 1.1, 1.1), EXPONENTS)
    assert found.correction.form.shaped
    _, g, p = found.correction.at(10.0)
    assert p == pytest.approx(1.1, abs=0.01) and np.exp(g) == pytest.approx(1.1, rel=0.01)
    x = load(np.random.Generator(np.random.PCG64(99)))
    ratio = loads(found.correction.apply(x, 10.0), EXPONENTS, 300.0) / loads(
        richer(x, 1.1, 1.1), EXPONENTS, 300.0
    )
    np.testing.assert_allclose(ratio, 1.0, atol=0.01)


def test_nothing_is_corrected_where_blocks_that_were_left_out_gain_nothing():
    found = fit(blocks_of(lambda v: 1.0, 1.0, noise=0.1), EXPONENTS)
    assert str(found.correction.form) == "none"
    x = load(np.random.Generator(np.random.PCG64(3)))
    np.testing.assert_array_equal(found.correction.apply(x, 10.0), x.mean() + (x - x.mean()))


def test_the_uncertainty_is_that_of_the_blocks():
    calm, noisy = (fit(blocks_of(lambda v: 1.2, 1.0, noise), EXPONENTS).correction for noise in (0.005, 0.05))
    spread = [np.std([c.at(10.0, i)[1] for i in range(len(c.resampled))]) for c in (calm, noisy)]
    assert 0.0005 < spread[0] < 0.01 < spread[1] < 0.05  # 0.05 over the root of eight blocks is 0.018


def test_it_says_where_it_extrapolates():
    correction = fit(blocks_of(lambda v: 1.2, 1.0), EXPONENTS).correction
    spread = sum(correction.spreads) / 2
    assert correction.extrapolates(12.0, spread) == ""
    assert "wind 24 m/s, trained 6 to 18" in correction.extrapolates(24.0, spread)
    assert "standard deviation" in correction.extrapolates(12.0, 3 * spread)
    assert correction.at(24.0) == correction.at(18.0)


# --- the other program's files


def test_units_stand_in_the_names_in_a_row_or_in_an_archive(tmp_path):
    named = tmp_path / "named.csv"
    named.write_text(
        "Time (s),RootMyb1 (kN-m),TwrBsMyt [MN·m],Odd (furlong)\n0,1,2,3\n0.05,2,3,4\n0.1,3,4,5\n"
    )
    out = tmp_path / "model.out"
    out.write_text(
        "made by another program\n\nTime\tRootMyb1\tTwrBsMyt\n(s)\t(kN-m)\t(kN-m)\n0\t1\t2000\n0.05\t2\t3000\n0.1\t3\t4000\n"
    )
    packed = tmp_path / "packed.npz"
    np.savez(
        packed,
        names=["RootMyb1", "TwrBsMyt"],
        units=["(kN-m)", "(kN-m)"],
        dt=0.05,
        data=np.array([[1, 2e3], [2, 3e3], [3, 4e3]]),
    )
    for path in (named, out, packed):
        found = read_series(path)
        np.testing.assert_allclose(found.time, [0, 0.05, 0.1])
        np.testing.assert_allclose(found.channel("RootMyb1"), [1e3, 2e3, 3e3])
        np.testing.assert_allclose(found.channel("tower_base_fore_aft_moment"), [2e6, 3e6, 4e6])
    with pytest.raises(InputError, match="Odd has the unit 'furlong', which is not known"):
        read_series(named).channel("Odd")
    with pytest.raises(InputError, match=r"has no channel RootMxb1; there are blade1_root_flapwise_moment"):
        read_series(named).channel("RootMxb1")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2\n", "no row begins with Time"),
        ("Time,RootMyb1\n0,1\n0.05,x\n0.1,2\n", "row 3 does not hold 2 numbers"),
        ("Time,RootMyb1\n0,1\n0.05,2\n0.2,2\n", "its times are not at equal steps"),
        ("Time,RootMyb1\n", "its times are not at equal steps"),
    ],
)
def test_a_file_that_is_no_series_is_refused(tmp_path, text, said):
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_series(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_series(tmp_path / "none.csv")


# --- the command, on a run of this program


@pytest.fixture(scope="module")
def ground(tmp_path_factory):
    """A run in three winds, and "another program's" series of the same: our logs with 8 % more flap and 5 % less edge."""
    from fatigue_runner.campaign import run_campaign

    folder = tmp_path_factory.mktemp("calibration")
    campaign = {
        "name": "same-winds", "duration": 140, "discard": 20, "output_rate": 20, "reference": None, "workers": 1,
        "wind": {"type": "turbulent", "speeds": [7, 8, 9], "intensity": 0.1, "seeds": [1]},
        "integrators": [{"method": "rk4", "step": 0.05}],
    }  # fmt: skip
    run_campaign(campaign, folder / "run")
    for path in (folder / "run" / "logs").glob("*.mcap"):
        log = read_log(path)
        columns = [
            log.time,
            richer(log.loads[FLAP], 1.08, 1.0) / 1e3,
            richer(log.loads[EDGE], 0.95, 1.0) / 1e3,
        ]
        rows = "\n".join(",".join(f"{v:.9g}" for v in row) for row in np.stack(columns, axis=1))
        (folder / f"{path.name[:6]}.csv").write_text(f"Time,RootMyb1 (kN-m),RootMxb1 (kN-m)\n{rows}\n")
    (folder / "calibration.yaml").write_text(
        "name: richer\nrun: run\nchannels: [RootMyb1, RootMxb1]\nseries:\n"
        "  - {case: v07.00, file: v07.00.csv}\n  - {case: v09.00, file: v09.00.csv}\n"
        "  - {case: v08.00, file: v08.00.csv, use: judge}\n"
    )
    return folder


def test_fit_writes_what_apply_uses(ground, tmp_path):
    out = tmp_path / "richer.json"
    done = CliRunner().invoke(app, ["fit", str(ground / "calibration.yaml"), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "within the winds that the fit saw: at most 2 %" in " ".join(done.output.split())
    found, judged = Calibration.read(out), calibrate(ground / "calibration.yaml")[1]
    assert json.loads(out.read_text())["runs"] == list(found.runs) and len(found.runs) == 2
    own = {j.channel: j for j in judged if j.use == "judge"}
    for channel, factor in ((FLAP, 1.08), (EDGE, 0.95)):
        np.testing.assert_allclose(own[channel].plain, 1 / factor - 1, rtol=1e-3)
        assert np.abs(own[channel].corrected).max() < 1e-3
    done = CliRunner().invoke(app, ["apply", str(out), str(ground / "run")])
    assert done.exit_code == 0, done.output
    with (ground / "run" / "calibrated.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * 2 * 5
    for row in rows:
        ratio = float(row["del_calibrated"]) / float(row["del"])
        assert ratio == pytest.approx(1.08 if row["channel"] == FLAP else 0.95, rel=1e-3)
        assert float(row["low"]) <= 1.001 * float(row["del_calibrated"]) <= 1.002 * float(row["high"])


def test_a_calibration_of_another_turbine_is_refused(ground, tmp_path):
    out = tmp_path / "richer.json"
    replace(calibrate(ground / "calibration.yaml")[0], turbine_hash="0" * 64).write(out)
    done = CliRunner().invoke(app, ["apply", str(out), str(ground / "run")])
    assert isinstance(done.exception, InputError) and "was run with another turbine" in str(done.exception)


@pytest.fixture(scope="module")
def made(ground):
    return calibrate(ground / "calibration.yaml")[0]


def test_what_somebody_may_want_to_keep_is_not_overwritten(ground, made, tmp_path):
    out, table = tmp_path / "richer.json", ground / "run" / "calibrated.csv"
    made.write(out)
    table.write_text("of another calibration")
    refused = CliRunner().invoke(app, ["apply", str(out), str(ground / "run")])
    assert isinstance(refused.exception, InputError) and "give --overwrite" in str(refused.exception)
    assert table.read_text() == "of another calibration"
    for more in (["--overwrite"], []):  # the same again is no other
        assert CliRunner().invoke(app, ["apply", str(out), str(ground / "run"), *more]).exit_code == 0
    out.write_text("mine")
    with pytest.raises(InputError, match="give --overwrite"):
        made.write(out, overwrite=False)
    assert out.read_text() == "mine"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda c, flap: c.update(wohler_exponents=[]), "without a channel or a Wöhler exponent"),
        (lambda c, flap: c.update(channels={}), "without a channel"),
        (lambda c, flap: flap.update(resampled=[]), f"{FLAP} has no resampled fits"),
        (lambda c, flap: flap.update(winds=[9, 7]), f"{FLAP} has figures that no fit makes"),
        (lambda c, flap: flap["resampled"][3][1].__setitem__(0, float("nan")), "figures that no fit makes"),
        (lambda c, flap: flap.update(degree=7), f"{FLAP} has the degree 7"),
        (lambda c, flap: flap.pop("winds"), "'winds'"),
    ],
)
def test_a_calibration_that_no_fit_wrote_is_refused(made, tmp_path, change, said):
    data = json.loads(to_checked(made.to_json()))
    data.pop("crc32")
    change(data, data["channels"][FLAP])
    path = tmp_path / "richer.json"
    path.write_bytes(to_checked(data))
    with pytest.raises(InputError, match=rf"richer\.json is no calibration \(.*{said}"):
        Calibration.read(path)


def test_a_flipped_bit_in_a_calibration_is_noticed(made, tmp_path):
    path = tmp_path / "richer.json"
    made.write(path)
    whole = path.read_bytes()
    place = whole.index(b'"resampled"') + 60
    place += next(i for i, sign in enumerate(whole[place:]) if sign in b"123456789")
    path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    with pytest.raises(InputError, match="its checksum is wrong"):
        Calibration.read(path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("v08.00.csv", "none.csv"), r"calibration\.yaml:7: .*none\.csv cannot be read"),
        (("case: v08", "case: v12"), r"calibration\.yaml:7: .* has no finished case that begins with 'v12"),
        (("RootMxb1", "RootMxb9"), r"calibration\.yaml:3: channels: 'RootMxb9' is no load"),
        (("use: judge", "use: test"), r"calibration\.yaml:7: series\[2\]\.use"),
        (("run: run", "run: nowhere"), "nowhere"),
        (("[RootMyb1, RootMxb1]", "[TwrBsMyt]"), "has no channel tower_base_fore_aft_moment"),
    ],
)
def test_what_is_wrong_in_the_file_is_told_with_its_line(ground, change, said):
    text = (ground / "calibration.yaml").read_text().replace(*change)
    path = ground / "wrong" / "calibration.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text.replace("run: run", "run: ../run").replace("file: v", "file: ../v"))
    with pytest.raises(InputError, match=said):
        calibrate(path)


@pytest.mark.slow(reason="two ten-minute runs in OpenFAST's fields")
@pytest.mark.skipif(not OPENFAST.is_dir(), reason="no OpenFAST results beside the checkout")
def test_blade_loads_meet_openfast_with_dynamic_stall_and_wake_to_two_per_cent(tmp_path):
    from fatigue_runner.campaign import run_campaign

    fields = [str(OPENFAST / f"ntmB_U{v:02d}_s1.bts") for v in (8, 18)]
    campaign = {
        "name": "fields", "operation": "controlled", "duration": 660, "discard": 60, "output_rate": 20, "reference": None,
        "wind": {"type": "full-field", "files": fields}, "integrators": [{"method": "rk4", "step": 0.05}], "workers": 1,
    }  # fmt: skip
    run_campaign(campaign, tmp_path / "run")
    series = "".join(
        f"  - {{case: ntmB_U{v:02d}_s1, file: {OPENFAST}/ntmB_U{v:02d}_s1_fullnt_series.npz}}\n"
        for v in (8, 18)
    )
    (tmp_path / "c.yaml").write_text(f"name: openfast\nrun: run\nseries:\n{series}")
    found, _ = calibrate(tmp_path / "c.yaml")
    for channel, without in ((FLAP, 0.03), (EDGE, 0.06), ("tower_base_fore_aft_moment", 0.04)):
        errors = found.block_errors[channel]
        assert errors["none"] > without and errors[str(found.corrections[channel].form)] < 0.02
    # two runs do not settle the side-side moment, whose blocks scatter by a fifth: it is left as it is
    assert str(found.corrections["tower_base_side_side_moment"].form) == "none"
