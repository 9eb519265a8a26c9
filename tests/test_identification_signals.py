"""Signals of logs: filter, differences, parallel decimation, edges, dead bands, choices."""

from __future__ import annotations

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.identification import choose_processing, equations
from robotmodels.identification.signals import (
    central_differences,
    piece_signals,
    pieces,
    settling,
    signals,
    zero_phase,
)
from robotmodels.logs import Log
from robotmodels.minimal_parameters import base_parameters

DT = 0.001


def gain(frequency: float, cutoff: float, order: int) -> complex:
    """Amplitude and phase of a sine after the filter, by least squares on its middle."""
    t = DT * np.arange(max(int(40.0 / (min(frequency, cutoff) * DT)), 8000))
    inner = slice(len(t) // 4, 3 * len(t) // 4)
    wave = np.exp(2j * np.pi * frequency * t)
    sines = np.column_stack((wave.real, wave.imag))[inner]
    return complex(*np.linalg.lstsq(sines, zero_phase(wave.real, cutoff, DT, order)[inner])[0])


@pytest.mark.parametrize("order", [1, 2, 4, 6])
@pytest.mark.parametrize("cutoff", [2.0, 300.0])
def test_the_filter_is_at_minus_three_decibels_at_its_cutoff(order, cutoff):
    assert abs(gain(cutoff, cutoff, order) - np.sqrt(0.5)) < 1e-6  # real: no delay


def test_the_filter_passes_below_and_stops_above_and_keeps_lines_up_to_its_ends():
    assert abs(gain(5.0, 50.0, 4) - 1.0) < 1e-6
    # two passes of the fourth order: 48 dB an octave, and more by the bilinear transform
    assert abs(gain(100.0, 50.0, 4)) < 10.0 ** (-40.0 / 20.0)
    t = DT * np.arange(3000)
    line = np.column_stack((2.0 + 0.3 * t, -t))
    np.testing.assert_allclose(zero_phase(line, 10.0, DT), line, atol=1e-9)


@pytest.mark.parametrize("order", [1, 4])
def test_the_filter_forgets_samples_beyond_its_settling_time(order):
    x = np.random.default_rng(0).normal(size=8000)
    margin = settling(20.0, DT, order)
    whole, part = (zero_phase(y, 20.0, DT, order) for y in (x, x[2000:6000]))
    inner = slice(margin, 4000 - margin)
    assert np.abs(whole[2000:6000][inner] - part[inner]).max() < 1e-12
    assert np.abs(whole[2000:6000] - part).max() > 1e-3  # at the ends they count


@pytest.mark.parametrize("accuracy", [2, 4, 6])
def test_central_differences_have_their_order(accuracy):
    error = []
    for dt in (0.02, 0.01):
        t = dt * np.arange(int(4.0 / dt))
        off = np.abs(central_differences(np.sin(3.0 * t), dt, accuracy) - 3.0 * np.cos(3.0 * t))
        error.append(off[10:-10].max())
    assert abs(np.log2(error[0] / error[1]) - accuracy) < 0.05
    assert central_differences(np.array([1.0, 3.0]), 0.5, accuracy).tolist() == [4.0, 4.0]


def moved(N: int) -> Log:
    """A log of a robot that moves, free of noise; its torques mean nothing."""
    rng = np.random.default_rng(3)
    t = DT * np.arange(N)[:, None]
    q = sum(
        rng.normal(size=6) * 0.4 * np.sin(2.0 * np.pi * f * t + rng.normal(size=6))
        for f in (0.13, 0.29, 0.53)
    )
    return Log(DT, q, rng.normal(size=q.shape))


def test_edges_are_cut_on_every_channel_of_every_recording():
    log = moved(12_000)
    log = Log(DT, log.q, log.tau, starts=(0, 1_000, 5_000))
    chosen = choose_processing(log, edges=0.75)
    found = signals(log, chosen)
    rows = np.concatenate((np.arange(1_750, 4_250), np.arange(5_750, 11_250)))
    np.testing.assert_allclose(found.t, DT * rows, rtol=1e-12)
    np.testing.assert_array_equal(found.tau, log.tau[rows])
    assert len(found.q) == len(found.v) == len(found.a) == len(rows)
    assert any("1 of 3 recordings (1000 samples) are not longer" in note for note in chosen.notes)


def test_dead_bands_are_four_standard_deviations_of_the_velocity_noise(rng):
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
    log = moved(20_000)
    base = base_parameters(rm.load("rx90"), drive=("Fv", "Fc"))
    band = np.linspace(0.05, 0.3, log.n)
    chosen = choose_processing(log, decimation=1, dead_band=band)
    # and 0.3 periods of the cutoff on either side, over which the filter smears a reversal
    assert abs(chosen.guard * log.dt * chosen.cutoff - 0.3) <= log.dt * chosen.cutoff
    inside, blocks = 0, equations(base, log, chosen).blocks()
    for piece, block in zip(pieces(log, chosen), blocks, strict=True):
        found = piece_signals(log, chosen, piece, 0)
        slow = np.abs(np.concatenate((found.before, found.v, found.after))) < band
        near = [slow[max(k - chosen.guard, 0) : k + chosen.guard + 1] for k in range(len(slow))]
        near = np.array([rows.any(axis=0) for rows in near])
        first = len(found.before)
        np.testing.assert_array_equal(block.use, ~near[first : first + len(block)])
        inside += int((~block.use).sum())
    assert 0.02 * log.n * len(log) < inside < 0.9 * log.n * len(log)


def test_measured_velocities_are_taken_and_filtered_alike():
    log = moved(20_000)
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
        ({"cutoff": 5.0, "filtered": False}, "filtered=False"),
        ({"decimation": 0}, "decimation"),
        ({"dead_band": [0.1, 0.2]}, "expected one velocity"),
        ({"accuracy": 3}, "2, 4 or 6"),
    ],
)
def test_choices_that_make_no_sense_are_named(options, match):
    with pytest.raises((InvalidValueError, ShapeError), match=match):
        choose_processing(moved(10_000), **options)
