"""Files from strangers: read as data, never run."""

from mocoflow_core.io.untrusted.container import (
    hdf5_rows,
    hdf5_shapes,
    read_hdf5,
    read_joblib,
    read_npy,
    read_npz,
    read_pickle,
    read_torch,
    read_untrusted,
)
from mocoflow_core.io.untrusted.folder import file_inside
from mocoflow_core.io.untrusted.limits import Limits

__all__ = [
    "Limits",
    "file_inside",
    "hdf5_rows",
    "hdf5_shapes",
    "read_hdf5",
    "read_joblib",
    "read_npy",
    "read_npz",
    "read_pickle",
    "read_torch",
    "read_untrusted",
]
