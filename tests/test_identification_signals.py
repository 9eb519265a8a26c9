"""Signals of logs: filters where they are asked for, differences, parallel decimation, edges."""

from __future__ import annotations

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.identification import (
    central_differences,
    choose_processing,
    decimation_window,
    equations,
    signals,
    zero_phase,
)
from robotmodels.identification.preparation.filters import settling
from robotmodels.identification.preparation.signals import piece_signals, pieces
from robotmodels.logs import Log
from robotmodels.minimal_parameters import base_parameters

DT = 0.001


def gain(frequency: float, cutoff: float, order: int, dt: float = DT) -> complex:
    """Amplitude and phase of a sine after the filter, by least squares on its middle."""
    t = dt * np.arange(max(int(40.0 / (min(frequency, cutoff) * dt)), 8000))
    inner = slice(len(t) // 4, 3 * len(t) // 4)
    wave = np.exp(2j * np.pi * frequency * t)
    y = zero_phase(wave.real, cutoff, dt, order)
    sines = np.column_stack((wave.real, wave.imag))[inner]
    c, s = np.linalg.lstsq(sines, y[inner], rcond=None)[0]
    return complex(c, s)


@pytest.mark.parametrize("order", [1, 2, 4, 6])
@pytest.mark.parametrize("cutoff", [2.0, 50.0, 300.0])
def test_the_filter_is_at_minus_three_decibels_where_it_is_asked_to(order, cutoff):
    found = gain(cutoff, cutoff, order)
    assert abs(found.real - np.sqrt(0.5)) < 1e-6
    assert abs(found.imag) < 1e-6  # no delay


def test_the_filter_passes_below_and_stops_above():
    assert abs(gain(5.0, 50.0, 4) - 1.0) < 1e-6
    # two passes of the fourth order: 48 dB an octave, and more by the bilinear transform
    assert abs(gain(100.0, 50.0, 4)) < 10.0 ** (-40.0 / 20.0)


def test_the_filter_keeps_lines_up_to_its_ends():
    t = DT * np.arange(3000)
    line = np.column_stack((2.0 + 0.3 * t, -t))
    np.testing.assert_allclose(zero_phase(line, 10.0, DT), line, atol=1e-9)


def test_what_is_farther_than_the_settling_does_not_count():
    rng = np.random.default_rng(0)
    x = rng.normal(size=8000)
    margin = settling(20.0, DT)
    whole, part = zero_phase(x, 20.0, DT), zero_phase(x[2000:6000], 20.0, DT)
    inner = slice(margin, 4000 - margin)
    assert np.abs(whole[2000:6000][inner] - part[inner]).max() < 1e-12
    assert np.abs(whole[2000:6000] - part).max() > 1e-3  # at the ends it does


@pytest.mark.parametrize("accuracy", [2, 4, 6])
def test_central_differences_have_their_order(accuracy):
    error = []
    for dt in (0.02, 0.01):
        t = dt * np.arange(int(4.0 / dt))
        off = np.abs(central_differences(np.sin(3.0 * t), dt, accuracy) - 3.0 * np.cos(3.0 * t))
        error.append(off[10:-10].max())
    assert abs(np.log2(error[0] / error[1]) - accuracy) < 0.05


def test_central_differences_of_few_samples_and_of_their_ends():
    assert central_differences([1.0, 3.0], 0.5).tolist() == [4.0, 4.0]
    x = np.arange(9.0) ** 2
    d = central_differences(x, 1.0, 6)
    np.testing.assert_allclose(d[1:-1], 2.0 * np.arange(9.0)[1:-1], rtol=1e-13)
    assert (d[0], d[-1]) == (1.0, 15.0)
    with pytest.raises(ShapeError):
        central_differences([1.0], 1.0)
    with pytest.raises(InvalidValueError, match="2, 4 or 6"):
        central_differences(x, 1.0, 3)


@pytest.mark.parametrize("step", [2, 5, 40])
def test_the_decimation_falls_to_half_at_four_tenths_of_the_new_rate(step):
    taps = decimation_window(step)
    k = np.arange(len(taps)) - len(taps) // 2

    def response(f):
        return float(taps @ np.cos(2.0 * np.pi * f / step * k))

    np.testing.assert_array_equal(taps, taps[::-1])
    assert abs(response(0.0) - 1.0) < 1e-14
    assert abs(response(0.4) - 0.5) < 0.01
    assert abs(response(0.2) - 1.0) < 0.01
    # what would appear as a lower frequency: above the new rate less the motion's
    assert max(abs(response(f)) for f in np.linspace(0.62, 0.5 * step, 200)) < 0.02


def moved(N: int = 40_000, name: str = "rx90", band: float = 0.0) -> tuple[Log, np.ndarray]:
    """A log of a robot that moves, free of noise, and its parameters."""
    model = rm.load(name)
    base = base_parameters(model, drive=("Fv", "Fc"))
    rng = np.random.default_rng(3)
    t = DT * np.arange(N)[:, None]
    q = sum(
        rng.normal(size=model.n) * 0.4 * np.sin(2.0 * np.pi * f * t + rng.normal(size=model.n))
        for f in (0.13, 0.29, 0.53)
    )
    v = central_differences(q, DT, 6)
    a = central_differences(v, DT, 6)
    x = rng.normal(size=len(base))
    W = rm.torque_regressor(model, q, v, a, columns=base, drive=base.drive)
    return Log(DT, q, W @ x), x


def test_regressor_and_torque_stay_equal_through_the_decimation():
    """Whatever the window cuts off, it cuts off on both sides alike."""
    log, x = moved()
    base = base_parameters(rm.load("rx90"), drive=("Fv", "Fc"))
    chosen = choose_processing(log, decimation=100, dead_band=0.0, accuracy=6, filtered=False)
    for block in equations(base, log, chosen).blocks():
        assert block.use.all()
        scale = np.abs(block.y).max()
        np.testing.assert_allclose(block.W @ x, block.y, atol=1e-9 * scale)


def test_edges_are_cut_on_every_channel_of_every_recording():
    log, _ = moved(12_000)
    log = Log(DT, log.q, log.tau, starts=(0, 5_000))
    chosen = choose_processing(log, edges=0.75)
    found = signals(log, chosen)
    assert chosen.edges == 750
    rows = np.concatenate((np.arange(750, 4_250), np.arange(5_750, 11_250)))
    np.testing.assert_allclose(found.t, DT * rows, rtol=1e-12)
    np.testing.assert_array_equal(found.tau, log.tau[rows])
    assert len(found.q) == len(found.v) == len(found.a) == len(rows)


def test_a_recording_of_edges_alone_has_no_rows():
    log, _ = moved(12_000)
    log = Log(DT, log.q, log.tau, starts=(0, 1_000))
    chosen = choose_processing(log, edges=0.75)
    assert all(piece.start >= 1_750 for piece in pieces(log, chosen))


def test_dead_bands_are_as_wide_as_noise_of_the_velocities_asks(rng):
    """Four standard deviations of white noise of the positions after filter and derivative."""
    t = np.arange(0.0, 20.0, DT)[:, None]
    q, level = np.sin(2.0 * np.pi * 0.5 * t), 2e-3
    clean, noisy = (
        choose_processing(Log(DT, x, np.zeros_like(q)), cutoff=20.0)
        for x in (q, q + level * rng.normal(size=q.shape))
    )
    assert clean.dead_band[0] == pytest.approx(0.003 * np.pi, rel=0.05)
    density = level**2 * 2.0 * DT  # one-sided, of white noise
    spread = np.sqrt(density * (2.0 * np.pi) ** 2 * 20.0**3 / 3.0)
    assert noisy.dead_band[0] == pytest.approx(4.0 * spread, rel=0.1)


def test_samples_in_the_dead_band_take_no_part():
    log, _ = moved()
    base = base_parameters(rm.load("rx90"), drive=("Fv", "Fc"))
    band = np.linspace(0.05, 0.3, log.n)
    chosen = choose_processing(log, decimation=1, dead_band=band)
    inside = 0
    for piece, block in zip(
        pieces(log, chosen), equations(base, log, chosen).blocks(), strict=True
    ):
        found = piece_signals(log, chosen, piece, 0)
        slow = np.abs(np.concatenate((found.before, found.v, found.after))) < band
        # and 0.3 periods of the cutoff on either side, over which the filter smears a reversal
        assert abs(chosen.guard * log.dt * chosen.cutoff - 0.3) <= log.dt * chosen.cutoff
        near = np.array(
            [
                slow[max(k - chosen.guard, 0) : k + chosen.guard + 1].any(axis=0)
                for k in range(len(slow))
            ]
        )
        first = len(found.before)
        np.testing.assert_array_equal(block.use, ~np.array(near)[first : first + len(block)])
        inside += int((~block.use).sum())
    assert 0.02 * log.n * len(log) < inside < 0.9 * log.n * len(log)
    everything = choose_processing(log, decimation=1, dead_band=0.0)
    assert all(block.use.all() for block in equations(base, log, everything).blocks())


@pytest.mark.parametrize("cutoff", [None, 8.0])
def test_pieces_are_the_one_pass_to_rounding(cutoff):
    """The filter of a piece sees enough beside it."""
    log, _ = moved(60_000)
    rng = np.random.default_rng(5)
    log = Log(DT, log.q + 1e-4 * rng.normal(size=log.q.shape), log.tau)
    chosen = choose_processing(log, cutoff=cutoff)
    found = signals(log, chosen)
    q = zero_phase(log.q, chosen.cutoff, DT, chosen.order)
    v = central_differences(q, DT, chosen.accuracy)
    a = central_differences(v, DT, chosen.accuracy)
    inner = slice(chosen.edges, len(log) - chosen.edges)
    assert len(list(pieces(log, chosen))) > 3
    # differences divide what rounding the filter has left by the sampling period, once and twice
    for name, one, tolerance in (("q", q, 1e-12), ("v", v, 1e-9), ("a", a, 1e-6)):
        off = np.abs(getattr(found, name) - one[inner]).max()
        assert off <= tolerance * np.abs(one).max(), (name, off)


def test_measured_velocities_are_taken_and_filtered_alike():
    log, _ = moved(20_000)
    v = np.cos(np.arange(20_000.0))[:, None] * np.ones(log.n)
    chosen = choose_processing(log, cutoff=20.0)
    found = signals(Log(DT, log.q, log.tau, v=v), chosen)
    rows = slice(chosen.edges, len(log) - chosen.edges)
    np.testing.assert_allclose(found.v, zero_phase(v, 20.0, DT)[rows], atol=1e-12)
    raw = choose_processing(log, filtered=False, edges=0.1)
    np.testing.assert_array_equal(signals(Log(DT, log.q, log.tau, v=v), raw).v, v[100:-100])


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"cutoff": 600.0}, "half the sampling rate"),
        ({"cutoff": 5.0, "filtered": False}, "filtered=False"),
        ({"decimation": 0}, "decimation"),
        ({"decimation": 2.5}, "decimation"),
        ({"dead_band": -1.0}, "no negative"),
        ({"edges": -0.1}, "edges"),
        ({"edges": 6.0}, "shorter edges"),
    ],
)
def test_choices_that_make_no_sense_are_named(options, match):
    log, _ = moved(10_000)
    with pytest.raises(InvalidValueError, match=match):
        choose_processing(log, **options)
    with pytest.raises(ShapeError, match="dead_band"):
        choose_processing(log, dead_band=[0.1, 0.2])
