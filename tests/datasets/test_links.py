"""What a stranger's data set links to stays where it is."""

from __future__ import annotations

import shutil

import pytest

from mocoflow_core.datasets.detect import detect_kind
from mocoflow_core.datasets.import_dataset import configure
from mocoflow_core.datasets.links import links_below, require_inside
from mocoflow_core.errors import InputError
from tests.datasets.aist_layout import SEQUENCE, write_aist
from tests.datasets.snapshot_layout import turning, write_snapshot
from tests.datasets.studio import Y_UP, Z_DOWN, studio
from tests.datasets.zju_layout import write_zju
from tests.small_smpl import write_smpl


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    folder = tmp_path_factory.mktemp("originals")
    small = {"frames": 3, "width": 32, "height": 48}
    write_zju(folder / "zju", studio(("Camera_B1", "Camera_B2"), Z_DOWN, **small))
    write_aist(folder / "aist", studio(("c01", "c09"), Y_UP, **small), None)
    write_smpl(folder / "SMPL_FEMALE.pkl")
    write_snapshot(folder / "snapshot", turning(3, 48, folder / "SMPL_FEMALE.pkl"))
    return folder


@pytest.fixture
def linked(originals, tmp_path):
    """A data set of which one file or folder is moved away, with a link in its place."""

    def make(name, part):
        folder = shutil.copytree(originals / name, tmp_path / name)
        shutil.move(folder / part, tmp_path / "private")
        (folder / part).symlink_to(tmp_path / "private")
        return folder

    return make


def read(folder, *settings):
    kind = detect_kind(folder)
    return kind.read(folder, configure(kind, ("bodies=none", *settings), None))


VIDEO = f"videos/{SEQUENCE.replace('cAll', 'c01')}.mp4"
PARTS = [
    ("zju", "annots.npy"),
    ("zju", "Camera_B1/000001.jpg"),
    ("zju", "Camera_B2"),
    ("zju", "mask/Camera_B2/000002.png"),
    ("zju", "new_vertices/1.npy"),
    ("aist", VIDEO),
    ("aist", "annotations/cameras"),
    ("aist", "annotations/cameras/mapping.txt"),
    ("aist", "annotations/cameras/setting10_2.json"),
    ("aist", "annotations/ignore_list.txt"),
    ("snapshot", "snapshot.mp4"),
    ("snapshot", "masks.hdf5"),
    ("snapshot", "consensus.pkl"),
]


@pytest.mark.parametrize(("name", "part"), PARTS)
def test_a_link_out_of_the_folder_is_refused_with_what_allows_it(linked, name, part):
    with pytest.raises(InputError, match=r"leads to .*private.*links=followed"):
        read(linked(name, part))


@pytest.mark.parametrize(
    ("name", "part"), [("zju", "Camera_B2"), ("aist", VIDEO), ("snapshot", "masks.hdf5")]
)
def test_links_are_followed_where_that_is_said(linked, name, part):
    assert len(read(linked(name, part), "links=followed").cameras) >= 1


def test_the_folder_itself_may_be_a_link_and_links_inside_are_fine(originals, tmp_path):
    folder = shutil.copytree(originals / "zju", tmp_path / "zju")
    (folder / "Camera_B1/000001.jpg").unlink()
    (folder / "Camera_B1/000001.jpg").symlink_to("000000.jpg")
    (tmp_path / "here").symlink_to(folder)
    assert len(read(tmp_path / "here").cameras) == 2


def test_a_ring_of_links_ends(tmp_path):
    (tmp_path / "data/a").mkdir(parents=True)
    (tmp_path / "data/a/up").symlink_to(tmp_path / "data")
    (tmp_path / "data/self").symlink_to("self")
    require_inside(tmp_path / "data", links_below(tmp_path / "data"), "inside")
