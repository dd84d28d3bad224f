"""One sound file of every kind that the reader admits, with what it holds."""

from __future__ import annotations

import collections
import pickle
from pathlib import Path

import h5py
import joblib
import numpy as np
import torch

from tests.python2_pickle import Forged, python2_pickle

TRACK = {
    "pose": np.arange(12, dtype=np.float32).reshape(4, 3),
    "columns": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "frame_ids": np.array([3, 4, 6]),
    "names": ["000001.jpg", "für"],
    "size": (720, 1280),
    "score": np.float32(0.5),
    "nothing": None,
}
PLAIN = TRACK | {"score": 0.5}
STATE = {"x": np.arange(6.0), "_dirty_vars": {"x"}, "_itr": None}
SPARSE = {
    "_shape": (2, 3),
    "data": np.array([0.5, 0.5, 1.0]),
    "indices": np.array([0, 1, 0], np.int32),
    "indptr": np.array([0, 1, 2, 3], np.int32),
}
TENSORS = {
    "pred_pose": torch.arange(6, dtype=torch.float32).reshape(2, 3),
    "turned": torch.arange(6).reshape(2, 3).T,
    "repeated": torch.ones(1, 10).expand(4, 10),
    "half": torch.ones(3, dtype=torch.bfloat16),
}


def write_valid_files(folder: Path) -> list[Path]:
    """The files; their names tell the kinds."""
    for protocol in range(6):
        (folder / f"protocol_{protocol}.pkl").write_bytes(pickle.dumps(TRACK, protocol))
    for protocol in range(3):
        content = {"track": dict(TRACK, names=["a"]), "state": Forged("chumpy.ch", "Ch", STATE)}
        content["sparse"] = Forged("scipy.sparse.csc", "csc_matrix", SPARSE)
        (folder / f"python2_{protocol}.pkl").write_bytes(python2_pickle(content, protocol))
    tracks = collections.defaultdict(dict, {np.int64(1): TRACK, np.int64(7): TRACK})
    joblib.dump(tracks, folder / "joblib.pkl")
    for method in ("zlib", "gzip", "bz2", "xz", "lzma"):
        joblib.dump(tracks, folder / f"joblib_{method}.pkl", compress=(method, 3))
    np.save(folder / "numbers.npy", TRACK["pose"])
    np.save(folder / "objects.npy", np.array(TRACK, object))
    np.save(folder / "tensors.npy", np.array(TENSORS, object))
    np.savez(folder / "stored.npz", pose=TRACK["pose"], results=np.array(TRACK, object))
    np.savez_compressed(folder / "deflated.npz", pose=TRACK["pose"], names=np.array(["a", "bc"]))
    torch.save({"smpl": TENSORS, "K": torch.eye(3)}, folder / "zip.pt")
    torch.save(TENSORS, folder / "old.pt", _use_new_zipfile_serialization=False)
    for version in ("earliest", "latest"):
        _write_hdf5(folder / f"{version}.hdf5", version)
    return sorted(folder.iterdir())


def _write_hdf5(path: Path, version: str) -> None:
    with h5py.File(path, "w", libver=version) as file:
        masks = (np.arange(4 * 16 * 16) % 2).astype(np.int8).reshape(4, 16, 16)
        file.create_dataset("masks", data=masks, compression="lzf")
        file.create_dataset("pose", data=np.ones((5, 72), ">f4"), compression="gzip", shuffle=True)
        file["betas"] = np.zeros(10, np.float32)
        file["group/trans"] = np.arange(6.0).reshape(2, 3)
