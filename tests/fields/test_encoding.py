from __future__ import annotations

import math

import pytest
import torch

from mocoflow_core.fields.encoding import FrequencyEncoding, band_weights

BANDS = 8


def points(count: int = 50) -> torch.Tensor:
    return 2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(0)) - 1


def test_band_alpha_zero_leaves_the_raw_coordinates():
    encoding = FrequencyEncoding(3, BANDS)
    for start in (lambda: None, lambda: encoding.anneal(0.0)):
        start()
        found = encoding(points())
        assert torch.equal(found[:, :3], points())
        assert torch.equal(found[:, 3:], torch.zeros(50, 6 * BANDS))


def test_the_window_is_monotone_and_ends_at_one():
    alphas = torch.linspace(0, BANDS, 400).tolist()
    windows = torch.stack([band_weights(alpha, BANDS) for alpha in alphas])
    assert (windows[1:] >= windows[:-1]).all()
    assert (windows[:, 1:] <= windows[:, :-1]).all()
    assert ((windows >= 0) & (windows <= 1)).all()
    assert torch.equal(windows[0], torch.zeros(BANDS).double())
    assert torch.equal(windows[-1], torch.ones(BANDS).double())
    assert torch.equal(band_weights(BANDS + 5.0, BANDS), windows[-1])


def test_a_band_is_half_on_half_way_through_its_turn():
    assert band_weights(2.5, 4).tolist() == pytest.approx([1, 1, 0.5, 0])


def test_the_window_has_neither_a_jump_nor_a_kink():
    step = 1e-3
    alphas = torch.arange(0, BANDS, step, dtype=torch.float64).tolist()
    windows = torch.stack([band_weights(alpha, BANDS) for alpha in alphas])
    slopes = windows.diff(dim=0) / step
    assert slopes.abs().max() <= 0.5 * math.pi + 1e-6
    # The slope's own slope is at most pi^2 / 2.
    assert slopes.diff(dim=0).abs().max() <= 0.5 * math.pi**2 * step + 1e-9


def test_with_all_bands_on_it_is_the_paper_s_encoding():
    encoding = FrequencyEncoding(1, 3)
    encoding.anneal(3.0)
    x = torch.tensor([[0.3]])
    found = encoding(x)[0]
    angles = [2**k * math.pi * 0.3 for k in range(3)]
    waves = {*(math.sin(a) for a in angles), *(math.cos(a) for a in angles)}
    assert encoding.width == found.numel() == 7
    assert sorted(found.tolist()) == pytest.approx(sorted({0.3, *waves}), abs=1e-6)


def test_coordinates_do_not_mix():
    encoding = FrequencyEncoding(3, 4)
    encoding.anneal(4.0)
    jacobian = torch.autograd.functional.jacobian(encoding, points(1)[0])
    assert jacobian.shape == (encoding.width, 3)
    assert ((jacobian != 0).sum(1) <= 1).all()


def test_the_encoding_changes_continuously_with_band_alpha():
    encoding = FrequencyEncoding(3, BANDS)
    for border in range(BANDS + 1):
        seen = []
        for alpha in (border - 1e-4, border + 1e-4):
            encoding.anneal(max(alpha, 0.0))
            seen.append(encoding(points()))
        assert (seen[1] - seen[0]).abs().max() < 1e-6


def test_the_window_is_part_of_the_state():
    trained = FrequencyEncoding(3, BANDS)
    trained.anneal(2.7)
    restored = FrequencyEncoding(3, BANDS)
    restored.load_state_dict(trained.state_dict())
    assert torch.equal(restored(points()), trained(points()))


def test_no_bands_are_the_raw_coordinates():
    encoding = FrequencyEncoding(3, 0)
    encoding.anneal(0.0)
    assert torch.equal(encoding(points()), points())


def test_sixteen_bands_of_time_stay_within_what_single_precision_can_tell():
    encoding = FrequencyEncoding(1, 16)
    encoding.anneal(16.0)
    times = torch.linspace(0, 1, 1001)[:, None]
    found = encoding(times).double()
    exact = encoding.double()(times.double())
    # The highest band multiplies time, exact to 2^-25, by 2^15 pi.
    assert (found - exact).abs().max() < 2**15 * math.pi * 2**-24
