"""Body model files of every age give the same model; what is no model says so."""

from __future__ import annotations

import re

import numpy as np
import pytest

from mocoflow_core.body.smpl_file import read_smpl_model
from mocoflow_core.errors import InputError
from tests.python2_pickle import python2_pickle
from tests.small_smpl import FULL, SMPL_PARENTS, small_smpl, write_smpl, write_smplx


def _same(model, arrays, shapes):
    expected = {
        "template": arrays["v_template"],
        "faces": arrays["f"],
        "shape_directions": arrays["shapedirs"][:, :, :shapes],
        "pose_directions": arrays["posedirs"],
        "joint_regressor": arrays["J_regressor"],
        "skinning_weights": arrays["weights"],
    }
    return all(np.allclose(getattr(model, k), v, rtol=1e-6, atol=1e-9) for k, v in expected.items())


@pytest.mark.parametrize("protocol", [0, 1, 2])
def test_pickles_of_python_2_with_chumpy_and_a_sparse_regressor(tmp_path, protocol):
    arrays = write_smpl(tmp_path / "SMPL_NEUTRAL.pkl", 600, protocol=protocol)
    model = read_smpl_model(tmp_path / "SMPL_NEUTRAL.pkl")

    assert _same(model, arrays, 10)
    assert tuple(model.parents) == SMPL_PARENTS
    assert model.template.dtype == np.float32


def test_conversions_to_npz_hold_the_same_model(tmp_path):
    arrays = write_smpl(tmp_path / "SMPL_MALE.npz", 600)
    assert _same(read_smpl_model(tmp_path / "SMPL_MALE.npz"), arrays, 10)


def test_models_with_300_shapes(tmp_path):
    arrays = small_smpl(600) | {"shapedirs": np.zeros((600, 3, 300))}
    (tmp_path / "v1.1.pkl").write_bytes(python2_pickle(arrays))
    assert read_smpl_model(tmp_path / "v1.1.pkl").shape_count == 300


def test_smplx_leaves_its_expressions_out(tmp_path):
    arrays = write_smplx(tmp_path / "SMPLX_NEUTRAL.npz", 600)
    model = read_smpl_model(tmp_path / "SMPLX_NEUTRAL.npz")
    assert _same(model, arrays, 300)
    assert model.joint_count == 55
    short = arrays | {"shapedirs": arrays["shapedirs"][:, :, :20]}
    (tmp_path / "SMPLX.pkl").write_bytes(python2_pickle(short))
    assert read_smpl_model(tmp_path / "SMPLX.pkl").shape_count == 10


def test_the_full_size_has_the_counts_of_the_original(tmp_path):
    write_smpl(tmp_path / "SMPL_NEUTRAL.pkl", FULL)
    model = read_smpl_model(tmp_path / "SMPL_NEUTRAL.pkl")
    assert (model.vertex_count, len(model.faces)) == (6890, 13776)
    assert model.pose_directions.shape == (6890, 3, 207)


@pytest.mark.parametrize("root", [4294967295, -1, 2**64 - 1])
def test_the_parent_of_the_root_may_be_spelled_in_any_way(tmp_path, root):
    arrays = small_smpl(600)
    table = arrays["kintree_table"].astype(object)
    table[0, 0] = root
    arrays["kintree_table"] = table.astype(np.int64 if root < 0 else np.uint64)
    (tmp_path / "model.pkl").write_bytes(python2_pickle(arrays))
    assert tuple(read_smpl_model(tmp_path / "model.pkl").parents) == SMPL_PARENTS


def test_without_a_model_it_is_said_which_one_and_where_and_what_works_without(tmp_path):
    with pytest.raises(InputError) as caught:
        read_smpl_model(tmp_path / "none.pkl")
    for text in ("SMPL_NEUTRAL.pkl", "https://smpl.is.tue.mpg.de", "VIBE, WHAM, ROMP", "none.pkl"):
        assert text in str(caught.value)


def test_other_files_are_told_from_models(tmp_path):
    for content in ({"pose": np.zeros(72)}, [1, 2], {"v_template": np.zeros((4, 3))}):
        (tmp_path / "other.pkl").write_bytes(python2_pickle(content))
        with pytest.raises(InputError, match="must be a body model with v_template, f, shapedirs"):
            read_smpl_model(tmp_path / "other.pkl")


FAULTS = {
    "template must be": ("v_template", lambda a: a[:, :2]),
    "template must be 0.4 to 4 m across": ("v_template", lambda a: 100 * a),
    "template must be finite": ("v_template", lambda a: np.where(a > 0.5, np.nan, a)),
    "faces must be (any, 3)": ("f", lambda a: a[:0]),
    "faces must name vertices 0 to 599": ("f", lambda a: a + 1),
    "shape_directions must be (600, 3, any)": ("shapedirs", lambda a: a[:-1]),
    "pose_directions must be (600, 3, 207)": ("posedirs", lambda a: a[:, :, :9]),
    "pose_directions must be finite": ("posedirs", lambda a: a + np.inf),
    "joint_regressor must be (24, 600)": ("J_regressor", lambda a: a.T),
    "each row of joint_regressor must sum to one": ("J_regressor", lambda a: 2 * a),
    "each row of skinning_weights must sum to one": ("weights", lambda a: 0.5 * a),
    "skinning_weights must not be negative": ("weights", lambda a: 3 * a - 2 * a[:, ::-1]),
    "the joints must form a tree": ("kintree_table", lambda a: np.stack([np.roll(a[0], 1), a[1]])),
    "must have a kintree_table (2, J)": ("kintree_table", lambda a: a[0]),
    "must hold numbers in": ("weights", lambda a: "none"),
}


@pytest.mark.parametrize("said", FAULTS)
def test_arrays_that_make_no_body_are_said(tmp_path, said):
    key, change = FAULTS[said]
    arrays = small_smpl(600)
    arrays[key] = change(arrays[key])
    (tmp_path / "model.pkl").write_bytes(python2_pickle(arrays))
    with pytest.raises(InputError, match=re.escape(said)):
        read_smpl_model(tmp_path / "model.pkl")
