"""Which pixels score a run while it goes on: the train camera's, and never trained on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from mocoflow_core.metrics.psnr import psnr
from mocoflow_core.rendering.trained_scene import TrainedScene
from mocoflow_core.training.batches import TrainingPixels
from mocoflow_core.training.held_out import HeldOutScore, draw_held_out
from mocoflow_core.training.snapshots import read_snapshots


@pytest.fixture
def nothing_held_out(prepared):
    """The same clip in which every frame is trained on."""
    return replace(prepared.clip, held_out=np.zeros_like(prepared.clip.held_out))


def test_pixels_come_from_held_out_frames_where_there_are_any(prepared):
    drawn = draw_held_out(prepared.clip, 100)
    assert len(drawn.rows) == 100
    assert prepared.clip.held_out[drawn.rows].all()
    assert "2 held-out frames of cam00" in drawn.description


def test_the_same_pixels_are_drawn_each_time(prepared):
    first, second = (draw_held_out(prepared.clip, 100) for _ in range(2))
    assert (first.rows == second.rows).all()
    assert (first.pixels == second.pixels).all()


def test_pixels_lie_on_the_person_or_next_to_it(prepared):
    clip = prepared.clip
    drawn = draw_held_out(clip, 10_000)
    picked = drawn.mask(clip).reshape(clip.masks.shape)
    assert (picked[clip.held_out] | ~clip.masks[clip.held_out]).all()  # All of the person.
    # And the one pixel around it that is 1/64 of 32, rounded up.
    assert picked[clip.held_out].sum() < 2.0 * clip.masks[clip.held_out].sum()


def test_blocks_are_kept_out_of_training_where_no_frame_is(prepared, nothing_held_out):
    drawn = draw_held_out(nothing_held_out, 64)
    kept_out = drawn.mask(nothing_held_out)
    assert 16 <= kept_out.sum() <= 64
    assert "no frame is held out" in drawn.description
    pixels = TrainingPixels(prepared.clip, prepared.scene())
    fewer = TrainingPixels(prepared.clip, prepared.scene(), drawn)
    training = kept_out[~prepared.clip.held_out]

    def marked(some: TrainingPixels) -> np.ndarray:
        row = torch.arange(len(some.counts)).repeat_interleave(some.counts)
        reached = np.zeros_like(training)
        reached[row, some.candidates] = True
        return reached

    assert (marked(pixels) & training).any()
    assert (marked(fewer) == (marked(pixels) & ~training)).all()


def test_a_scene_without_a_mask_has_nothing_to_score(prepared):
    assert draw_held_out(replace(prepared.clip, masks=prepared.clip.masks & False), 100) is None


def test_the_score_is_that_of_the_same_pixels_of_a_rendered_view(prepared, trained):

    clip = prepared.clip
    drawn = draw_held_out(clip, 2048)
    scene = TrainedScene.open(trained)
    behind = clip.background.astype(np.float32) / 255.0
    views = [
        scene.render(clip.camera, clip.times[row], behind)[0] for row in range(len(clip.times))
    ]
    seen = np.stack(views).reshape(len(clip.times), -1, 3)[drawn.rows, drawn.pixels]
    truth = clip.frames.reshape(len(clip.times), -1, 3)[drawn.rows, drawn.pixels] / 255.0
    assert read_snapshots(trained)[-1].train_psnr == pytest.approx(psnr(seen, truth), abs=1e-3)


def test_scoring_draws_no_random_numbers_and_changes_no_weight(prepared):
    field = prepared.field()
    drawn = draw_held_out(prepared.clip, 100)
    score = HeldOutScore.prepare(prepared.clip, drawn, prepared.space, field)
    state, weights = torch.get_rng_state(), [p.clone() for p in field.parameters()]
    assert score() == score()
    assert torch.equal(torch.get_rng_state(), state)
    assert all(map(torch.equal, weights, field.parameters()))
    assert all(p.grad is None for p in field.parameters())
