"""Damage-equivalent loads: the shared known answers of every kind, closed forms, and their own laws."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from load_series import VARYING
from places import SHARED

from fatigue_runner import fatigue as fa
from fatigue_runner.errors import InputError
from fatigue_runner.fatigue.climate import IEC_REFERENCE_SPEED
from fatigue_runner.fatigue.damage import channel_condition

CASES_FILE = SHARED / "fatigue_cases.json"
CASES = json.loads(CASES_FILE.read_text()) if CASES_FILE.exists() else []

# ASTM E1049-85, figure 6; the damage follows by hand from the standard's counts of each range.
ASTM_SERIES = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]
ASTM_DAMAGE_4 = 0.5 * 3**4 + 1.5 * 4**4 + 0.5 * 6**4 + 1.0 * 8**4 + 0.5 * 9**4
EXPONENTS = [3, 4, 5, 10, 12]

unhurried = settings(deadline=None)  # the first example may compile the counter
wohler = st.floats(1.0, 15.0)


def a_load(n=3000, seed=0):
    rng = np.random.default_rng(seed)
    t = 0.02 * np.arange(n)
    return 1e6 * (np.sin(2 * np.pi * 0.2 * t) + 0.1 * np.cumsum(rng.standard_normal(n)) + 5.0)


# --- known answers in the shared file: one check per kind of case, and no kind without a check


def check_rainflow(case):
    given_, expected = case["input"]["series"], case["expected"]
    ranges, means, counts = fa.rainflow(given_)
    found = {size: counts[ranges == size].sum() for size in set(ranges.tolist())}
    assert found == {float(size): count for size, count in expected["counts"].items()}
    assert counts.sum() == expected["total_cycles"]
    for m, load in expected["del_Neq1"].items():
        assert fa.damage_equivalent_load(given_, float(m), 1.0) == pytest.approx(
            load, rel=case["tolerance_rel"]
        )
    if "cycles_range_mean_count_i_j" in expected:
        in_order = [tuple(cycle[:3]) for cycle in expected["cycles_range_mean_count_i_j"]]
        assert list(zip(ranges, means, counts, strict=True)) == in_order


def check_edge(case):
    if case["id"] == "constant_series":
        assert fa.damage_equivalent_load(case["input"]["series"], 4, 10.0) == case["expected"]["del_"]
    else:
        assert case["id"] == "nan_sample"
        values = np.where(np.arange(100) == 10, np.nan, np.sin(np.arange(100)))
        with pytest.raises(InputError, match="index 10"):
            fa.damage_equivalent_load(values, 4, 10.0)


def check_analytic(case):
    values = 3 * np.cos(2 * np.pi * np.arange(6001) / 100)
    assert fa.rainflow(values)[2].sum() == case["expected"]["total_cycles"]
    for m, load in case["expected"]["del_1hz"].items():
        found = fa.damage_equivalent_load(values, float(m), fa.short_term_cycles(600.0))
        assert found == pytest.approx(load, rel=case["tolerance_rel"])


def check_damage(case):
    sn = case["input"]["sn"]
    curve = fa.SNCurve.through("linear", sn["Sc"], sn["Nc"], (float(sn["m"]),), source=case["source"])
    damage = fa.miner_damage(case["input"]["stress_ranges"], case["input"]["counts"], curve)
    assert damage == pytest.approx(case["expected"]["damage"], rel=case["tolerance_rel"])


def check_mean_stress(case):
    ranges, means = case["input"]["S"], case["input"]["Sm"]
    found = [fa.goodman(ranges, means, strength) for strength in case["input"]["su"]]
    np.testing.assert_allclose(found, case["expected"]["S_eq"], rtol=case["tolerance_rel"])


def check_weibull(case):
    given_, expected = case["input"], case["expected"]
    climate = fa.iec_climate(given_["class_"])
    assert IEC_REFERENCE_SPEED[given_["class_"]] == given_["V_ref"]
    assert (climate.mean_speed, climate.shape) == (given_["V_ave"], given_["k"])
    found = fa.bin_probabilities(climate, given_["bins"], given_["bin_width"])
    np.testing.assert_allclose(found, expected["prob_cdf"], rtol=case["tolerance_rel"])
    assert found.sum() == pytest.approx(expected["sum_prob"], rel=case["tolerance_rel"])
    np.testing.assert_allclose(found * 8760, expected["hours_per_year"], rtol=case["tolerance_rel"])


def check_lifetime(case):
    given_, seconds = case["input"], 20 * 8760 * 3600.0
    found = fa.lifetime_equivalent_load(given_["del_1hz"], given_["prob"], given_["m"], n_eq=seconds)
    assert found.load == pytest.approx(case["expected"]["lifetime_del_power_mean"], rel=case["tolerance_rel"])
    assert found.load != pytest.approx(case["expected"]["linear_mean_is_wrong"], rel=0.1)


def check_iec(case):
    # The turbulence of the case belongs to the wind; the class's reference speed is ours.
    assert 1.4 * IEC_REFERENCE_SPEED["I"] == pytest.approx(
        case["expected"]["Ve50"], rel=case["tolerance_rel"]
    )


def check_spectral(case):
    rates = narrow_band_damage_rates((3, 4, 5))
    for m, rate in rates.items():
        expected = case["expected"][str(m)]["damage_rate_times_K"]
        assert rate == pytest.approx(expected, rel=case["tolerance_rel"])


def check_property(case):
    values = np.array(case["input"]["series"], dtype=float)
    moved = -7.5 * values + 100
    ratio = fa.damage_equivalent_load(moved, EXPONENTS, 1.0) / fa.damage_equivalent_load(
        values, EXPONENTS, 1.0
    )
    np.testing.assert_allclose(ratio, case["expected"]["del_ratio"], rtol=case["tolerance_rel"])
    np.testing.assert_array_equal(fa.rainflow(moved)[2], fa.rainflow(values)[2])


CHECKS = {
    "rainflow_astm_halfcycle_residue": check_rainflow,
    "edge": check_edge,
    "analytic": check_analytic,
    "damage": check_damage,
    "mean_stress": check_mean_stress,
    "weibull": check_weibull,
    "lifetime": check_lifetime,
    "iec": check_iec,
    "spectral": check_spectral,
    "property": check_property,
}


@pytest.mark.skipif(not CASES, reason=f"no shared fatigue cases at {CASES_FILE}")
@pytest.mark.parametrize("case", CASES, ids=[case["id"] for case in CASES])
def test_the_shared_case_has_its_known_answer(case):
    CHECKS[case["kind"]](case)


# --- damage-equivalent loads


def narrow_band_damage_rates(exponents, duration=2.0**21 / 20.0, seeds=6):
    """Damage per second of noise with a flat PSD in 0.49-0.51 Hz and variance 1, at 20 Hz, on N = S^-m."""
    n, rate = round(duration * 20), dict.fromkeys(exponents, 0.0)
    band = np.arange(math.ceil(0.49 * duration), math.floor(0.51 * duration) + 1)
    for seed in range(seeds):
        spectrum = np.zeros(n // 2 + 1, complex)
        spectrum[band] = np.exp(2j * np.pi * np.random.default_rng(seed).random(band.size))
        series = np.fft.irfft(spectrum, n) * n / math.sqrt(2 * band.size)
        found = fa.damage_equivalent_load(series, list(exponents), duration)
        for m, load in zip(exponents, found, strict=True):
            rate[m] += load**m / seeds
    return rate


@pytest.mark.parametrize(("m", "tolerance"), [(3, 0.01), (4, 0.02), (5, 0.04)])
def test_narrow_band_noise_does_the_damage_of_rayleigh_distributed_ranges(m, tolerance):
    # E[D]/T = nu0 (2 sqrt(2 m0))^m Gamma(1 + m/2): Miles (1954). The mean of six realisations of 105 000 s
    # scatters by 0.3, 0.7 and 1.3 % (standard deviation, measured over 30 seeds).
    expected = 0.5 * 8 ** (m / 2) * math.gamma(1 + m / 2)
    assert narrow_band_damage_rates((m,))[m] == pytest.approx(expected, rel=tolerance)


def test_the_del_of_the_standard_example_is_the_power_sum_of_its_counts():
    assert fa.damage_equivalent_load(ASTM_SERIES, 4, 1.0) == pytest.approx(ASTM_DAMAGE_4**0.25, rel=1e-14)
    assert fa.damage_equivalent_load(ASTM_SERIES, 4, n_eq=16.0) == pytest.approx(
        ASTM_DAMAGE_4**0.25 / 2, rel=1e-14
    )


def test_a_sine_of_amplitude_a_has_del_2a_when_its_cycles_are_the_equivalent_cycles():
    values = 3 * np.cos(2 * np.pi * np.arange(6001) / 100)
    np.testing.assert_allclose(fa.damage_equivalent_load(values, EXPONENTS, 60.0), 6.0, rtol=1e-12)


def test_several_exponents_at_once_give_the_loads_of_each_alone():
    values = a_load()
    together = fa.damage_equivalent_load(values, EXPONENTS, 60.0)
    assert together.tolist() == [fa.damage_equivalent_load(values, m, 60.0) for m in EXPONENTS]
    assert isinstance(fa.damage_equivalent_load(values, 10, 60.0), float)


@unhurried
@given(VARYING, wohler, st.floats(1e-3, 1e6))
def test_the_del_is_proportional_to_the_load(values, m, factor):
    scaled = fa.damage_equivalent_load(factor * np.array(values), m, 600.0)
    assert scaled == pytest.approx(factor * fa.damage_equivalent_load(values, m, 600.0), rel=1e-9)


@unhurried
@given(st.lists(st.integers(-1000, 1000), min_size=3, max_size=60), wohler, st.integers(-(10**6), 10**6))
def test_a_constant_added_to_the_load_does_not_change_the_del(values, m, offset):
    moved = fa.damage_equivalent_load(np.array(values) + offset, m, 600.0)
    assert moved == fa.damage_equivalent_load(values, m, 600.0)


@unhurried
@given(st.lists(st.integers(-1000, 1000), min_size=3, max_size=60), wohler)
def test_the_series_backwards_has_the_same_del(values, m):
    backwards = fa.damage_equivalent_load(values[::-1], m, 600.0)
    assert backwards == pytest.approx(fa.damage_equivalent_load(values, m, 600.0), rel=1e-12)


@unhurried
@given(VARYING)
def test_a_large_exponent_tends_to_the_largest_range(values):
    assert fa.damage_equivalent_load(values, 1e6, 600.0) == pytest.approx(max(values) - min(values), rel=1e-4)


@unhurried
@given(VARYING, wohler, st.floats(1.0, 20.0))
def test_the_del_for_one_equivalent_cycle_per_cycle_grows_with_the_exponent(values, m, more):
    ranges, _, counts = fa.rainflow(values)
    low, high = fa.equivalent_load(ranges, counts, [m, m + more], counts.sum())
    assert low <= high * (1 + 1e-12)


@unhurried
@given(VARYING, VARYING, wohler)
def test_bins_combine_by_power_sum(first, second, m):
    cycles = [fa.rainflow(values) for values in (first, second)]
    both = fa.equivalent_load(
        np.concatenate([c[0] for c in cycles]), np.concatenate([c[2] for c in cycles]), m, 1200.0
    )
    parts = [fa.equivalent_load(c[0], c[2], m, 600.0) for c in cycles]
    largest = max(parts)
    combined = largest * np.mean([(part / largest) ** m for part in parts]) ** (1 / m)
    assert both == pytest.approx(combined, rel=1e-9)


def test_no_power_overflows_or_vanishes_for_huge_and_tiny_units():
    for unit in (1e-200, 1e200):
        load = fa.damage_equivalent_load(np.array(ASTM_SERIES) * unit, 12, 1.0)
        # 8.784... is the standard example's DEL for m = 12, from its counts in whole numbers.
        assert load == pytest.approx(8.784123808588829 * unit, rel=1e-12)


def test_the_residue_matters_as_stated_half_lies_between_drop_and_full():
    drop, half, full = (
        fa.damage_equivalent_load(ASTM_SERIES, 4, 1.0, residue) for residue in ("drop", "half", "full")
    )
    assert drop == pytest.approx(4.0)  # only the closed cycle of range 4
    assert full**4 == pytest.approx(2 * ASTM_DAMAGE_4 - 4.0**4)
    assert drop < half < full


def test_a_constant_has_no_load():
    assert fa.damage_equivalent_load([5.0] * 10, EXPONENTS, 600.0).tolist() == [0.0] * 5


@pytest.mark.parametrize(
    ("ranges", "counts", "m", "n_eq", "message"),
    [
        ([1.0, np.nan], [1, 1], 4, 1.0, "load ranges must be finite and not negative, got nan at index 1"),
        ([1.0, -2.0], [1, 1], 4, 1.0, "load ranges must be finite and not negative, got -2.0 at index 1"),
        ([1.0], [-0.5], 4, 1.0, "cycle counts must be finite and not negative, got -0.5 at index 0"),
        ([1.0, 2.0], [1.0], 4, 1.0, "of one length"),
        ([1.0], [1.0], 0, 1.0, "the Wöhler exponent m must be finite and above zero, got 0"),
        ([1.0], [1.0], [3, -4], 1.0, "the Wöhler exponent m must be finite and above zero, got -4"),
        ([1.0], [1.0], 4, 0.0, "n_eq must be finite and above zero"),
    ],
)
def test_wrong_cycles_and_exponents_are_refused_in_a_sentence(ranges, counts, m, n_eq, message):
    with pytest.raises(InputError, match=message):
        fa.equivalent_load(ranges, counts, m, n_eq)


# --- channels, errors and ratios


def test_a_channel_is_its_dels_its_cycles_and_its_largest_range():
    values = a_load()
    channel = fa.channel_fatigue(values, EXPONENTS, duration=60.0)
    assert channel.condition is None
    assert channel.loads == dict(
        zip(EXPONENTS, fa.damage_equivalent_load(values, EXPONENTS, 60.0), strict=True)
    )
    assert channel.load(10) == fa.damage_equivalent_load(values, 10, 60.0)
    assert channel.largest_range == pytest.approx(np.ptp(values))
    assert channel.cycles == fa.rainflow(values)[2].sum()


@pytest.mark.parametrize(
    ("values", "condition"),
    [
        ([1.0, 2.0, np.nan, np.inf], "not finite from sample 2 of 4"),
        ([3.0, 4.0], "only 2 samples"),
        ([7.0] * 9, "constant"),
        (7e6 + 1e-8 * np.arange(9.0), "constant"),
        ([0.0] * 9, "constant"),
        ([1e308, -1e308, 1e308], "range beyond the largest number"),
    ],
)
def test_a_channel_without_fatigue_states_why_and_gives_no_number(values, condition):
    channel = fa.channel_fatigue(values, EXPONENTS, duration=60.0)
    assert channel.condition == condition
    assert channel.loads == {} and channel.load(4) is None


def test_a_small_load_on_a_large_mean_is_no_constant():
    assert channel_condition(1e7 + np.sin(np.arange(100.0))) is None


def test_an_amplitude_error_of_e_is_m_e_in_damage():
    values, e = a_load(), 1e-4
    for m in EXPONENTS:
        load, reference = (fa.damage_equivalent_load(x, m, 60.0) for x in ((1 + e) * values, values))
        assert fa.load_error(load, reference) == pytest.approx(e, rel=1e-6)
        assert fa.damage_ratio(load, reference, m) - 1 == pytest.approx(m * e, rel=1e-3)


def test_errors_against_no_load_or_without_a_load_are_unknown_rather_than_numbers():
    assert fa.load_error(1.0, 0.0) is None and fa.damage_ratio(1.0, 0.0, 4) is None
    assert fa.load_error(None, 1.0) is None and fa.damage_ratio(1.0, None, 4) is None
    assert fa.load_error(0.0, 2.0) == -1.0 and fa.damage_ratio(0.0, 2.0, 4) == 0.0
    assert fa.damage_ratio(1e300, 1e-3, 12) == math.inf


# --- mean stress


def test_goodman_corrects_as_published():
    # fatpack's test of S / (1 - Sm / su), su = 510
    np.testing.assert_allclose(
        fa.goodman([10, 30, 24, 90], [20, 40, 32, 0], 510.0),
        [10.408163, 32.553191, 25.606695, 90.0],
        rtol=1e-7,
    )


def test_goodman_leaves_ranges_at_the_fixed_mean_and_credits_compression():
    assert fa.goodman([10.0], [50.0], 500.0, fixed_mean=50.0).tolist() == [10.0]
    assert fa.goodman([10.0], [-100.0], 500.0)[0] < 10.0 < fa.goodman([10.0], [100.0], 500.0)[0]


def test_goodman_on_request_raises_the_del_of_a_load_in_tension():
    values = a_load() + 2e7
    strength = 20 * values.max()
    ranges, means, counts = fa.rainflow(values)
    corrected = fa.damage_equivalent_load(values, 4, 60.0, ultimate=strength)
    by_hand = fa.equivalent_load(ranges / (1 - means / strength), counts, 4, 60.0)
    assert corrected == pytest.approx(by_hand, rel=1e-12)
    assert corrected > fa.damage_equivalent_load(values, 4, 60.0)


def test_a_mean_at_the_ultimate_strength_is_refused_as_static_failure():
    with pytest.raises(InputError, match="a mean of 510 reaches the ultimate strength 510: static failure"):
        fa.goodman([10.0], [510.0], 510.0)


# --- the house


def test_importing_fatigue_loads_neither_numba_nor_the_simulation():
    code = "import sys, fatigue_runner.fatigue; print(*sys.modules)"
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    loaded = {name for name in found if name.split(".")[0] in ("numba", "scipy", "fatigue_runner")}
    outside = {name for name in loaded if not name.startswith("fatigue_runner.fatigue")}
    names = ("errors", "channels", "values", "_version")
    assert outside <= {"fatigue_runner", *(f"fatigue_runner.{name}" for name in names)}


MASKED = np.ma.array([1.0, 9.0, 2.0], mask=[False, True, False])


@pytest.mark.parametrize(
    "figure",
    [
        lambda: fa.damage_equivalent_load(MASKED, 4, 1.0),
        lambda: fa.equivalent_load(MASKED, [1, 1, 1], 4, 1.0),
        lambda: fa.equivalent_load([1, 1, 1], MASKED, 4, 1.0),
        lambda: fa.goodman([1, 1, 1], MASKED, 100.0),
    ],
)
def test_what_lies_below_a_mask_has_no_load(figure):
    with pytest.raises(fa.FatigueInputError, match="masked at index 1"):
        figure()


def test_a_masked_channel_is_a_stated_condition():
    assert fa.channel_fatigue(MASKED, [4], 1.0).condition == "not finite from sample 1 of 3"
