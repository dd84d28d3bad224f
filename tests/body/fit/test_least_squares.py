import numpy as np

from mocoflow_core.body.fit.least_squares import System


def test_a_step_solves_the_whole_clip_at_once():
    """Against the dense normal equations, smoothness and shared unknowns included."""
    random = np.random.default_rng(0)
    frames, unknowns, shared, rows = 6, 4, 3, 7
    residuals = random.standard_normal((frames, rows))
    by_frame = random.standard_normal((frames, rows, unknowns))
    by_shared = random.standard_normal((frames, rows, shared))
    stiffness = np.array([1.0, 2.0, 0.5, 3.0])
    system = System.of(0.0, residuals, by_frame, by_shared)
    smooth = System.nothing(frames, unknowns, shared)
    smooth = System(**{**vars(smooth), "smoothness": stiffness})
    step, common = (system + smooth).step(0.0)

    dense = np.zeros((frames * rows, frames * unknowns + shared))
    for t in range(frames):
        dense[t * rows : (t + 1) * rows, t * unknowns : (t + 1) * unknowns] = by_frame[t]
        dense[t * rows : (t + 1) * rows, frames * unknowns :] = by_shared[t]
    bend = np.diff(np.eye(frames), 2, axis=0)
    matrix = dense.T @ dense
    matrix[: frames * unknowns, : frames * unknowns] += np.kron(bend.T @ bend, np.diag(stiffness))
    expected = -np.linalg.solve(matrix, dense.T @ residuals.ravel())
    np.testing.assert_allclose(np.append(step.ravel(), common), expected, atol=1e-8)
