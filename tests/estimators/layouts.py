"""One posed person, written as each tool would write it: the layouts, byte by byte as the tools do.

Tools see the person through cameras of their own; what they store is computed here from the pixel
and the size of the body's middle, which is all that a picture tells.
"""

from __future__ import annotations

import json
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import joblib
import numpy as np
import torch
from scipy.spatial.transform import Rotation

from mocoflow_core.body.blend_skinning import posed_joints, posed_vertices
from mocoflow_core.body.smpl_model import SmplModel
from mocoflow_core.geometry.camera import Camera

FOCAL_PX = (900.0, 930.0)
K = np.array([[FOCAL_PX[0], 0, 270], [0, FOCAL_PX[1], 260], [0, 0, 1]])
CAMERA = Camera("cam00", 640, 480, K, np.eye(3), np.zeros(3))
MIDDLE = np.array([320.0, 240.0])


@dataclass(frozen=True, eq=False)
class Person:
    """Pose, shape and place of a body in the camera's axes."""

    model: SmplModel
    pose: np.ndarray  # (T, J, 3)
    betas: np.ndarray  # (S,)
    translations: np.ndarray  # (T, 3)

    @classmethod
    def of(cls, model: SmplModel, frames: int = 4, seed: int = 0) -> Person:
        random = np.random.default_rng(seed)
        joints = len(model.parents)
        pose = random.normal(0, 0.15, (frames, joints, 3))
        pose[:, 0] = Rotation.from_euler("x", 170, degrees=True).as_rotvec() + pose[:, 0]
        betas = random.normal(0, 1, min(model.shape_directions.shape[-1], 10))
        path = np.linspace([-0.4, 0.1, 3.6], [0.5, 0.2, 4.2], frames)
        return cls(model, pose.astype(np.float32), betas.astype(np.float32), path)

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def matrices(self) -> np.ndarray:
        flat = Rotation.from_rotvec(self.pose.reshape(-1, 3)).as_matrix()
        return flat.reshape(*self.pose.shape, 3).astype(np.float32)

    @property
    def bodies(self) -> np.ndarray:
        """(T, V, 3) about the model's own origin."""
        return posed_vertices(self.model, self.pose, self.betas)

    @property
    def vertices(self) -> np.ndarray:
        """(T, V, 3) where they stand, in the camera's axes."""
        return self.bodies + self.translations[:, None]

    @property
    def hips(self) -> np.ndarray:
        """(T, 3) the middle between the hips, from the model's origin."""
        return posed_joints(self.model, self.pose, self.betas)[:, 1:3].mean(axis=1)

    @property
    def middles(self) -> np.ndarray:
        return self.bodies.mean(axis=1)

    def seen(self) -> tuple[np.ndarray, np.ndarray]:
        """Pixel (T, 2) of the body's middle and pixels per metre there (T,)."""
        return CAMERA.project(self.middles + self.translations), np.sqrt(np.prod(FOCAL_PX)) / (
            self.middles + self.translations
        )[:, 2]

    def for_camera(self, focal_px: float, centre=MIDDLE) -> np.ndarray:
        """Translations (T, 3) with which another camera sees the same."""
        pixels, scale_px = self.seen()
        depth = focal_px / scale_px
        points = np.column_stack([(pixels - centre) * (depth / focal_px)[:, None], depth])
        return points - self.middles

    def weak(self) -> tuple[np.ndarray, np.ndarray]:
        """Pixels per metre (T,), pixel of the model's origin (T, 2) of a weak camera."""
        pixels, scale_px = self.seen()
        return scale_px, pixels - scale_px[:, None] * self.middles[:, :2]

    def shapes(self, wobble: float = 0.0) -> np.ndarray:
        """(T, S): the shape, and as much more or less of it in turn."""
        signs = np.resize([0, 1, -1], len(self))[:, None]
        return (self.betas * (1 + wobble * signs)).astype(np.float32)


def vibe_record(person: Person, frames=None, factor: float = 1.1, betas=None) -> dict:
    """One person of ``vibe_output.pkl``; ``orig_cam`` is made without the crop factor, as there."""
    scale_px, origin_px = person.weak()
    betas = person.shapes() if betas is None else betas
    side = np.full(len(person), 260.0)
    s = scale_px * 2 / (factor * side)
    box_centre = origin_px + np.array([4.0, 30.0])
    cam = np.column_stack([s, (origin_px - box_centre) / scale_px[:, None]]).astype(np.float32)
    sx, sy = s * side / CAMERA.width, s * side / CAMERA.height
    tx = (box_centre[:, 0] - 320) / 320 / sx + cam[:, 1]
    ty = (box_centre[:, 1] - 240) / 240 / sy + cam[:, 2]
    frames = np.arange(len(person)) if frames is None else np.asarray(frames)
    return {
        "pred_cam": cam,
        "orig_cam": np.stack([sx, sy, tx, ty]).T,
        "verts": posed_vertices(person.model, person.pose, betas).astype(np.float32),
        "pose": person.pose.reshape(len(person), 72),
        "betas": betas,
        "joints3d": np.zeros((len(person), 49, 3), np.float32),
        "joints2d": None,
        "joints2d_img_coord": np.zeros((len(person), 49, 2), np.float32),
        "bboxes": np.column_stack([box_centre, side, side]),
        "frame_ids": frames,
    }


def pare_record(person: Person) -> dict:
    record = vibe_record(person, factor=1.0)
    record.pop("joints2d_img_coord")
    return {**record, "pose": person.matrices, "smpl_joints2d": np.zeros((len(person), 49, 2))}


def wham_record(person: Person, focal_px: float = 800.0) -> dict:
    """One person of ``wham_output.pkl``; 800 px are the diagonal of 640 x 480."""
    translations = person.for_camera(focal_px)
    return {
        "pose": person.pose.reshape(len(person), 72),
        "trans": translations.astype(np.float32),
        "pose_world": np.zeros((len(person), 72), np.float32),
        "trans_world": np.zeros((len(person), 3), np.float32),
        "betas": person.shapes(),
        "verts": (person.bodies + translations[:, None]).astype(np.float32),
        "frame_ids": np.arange(len(person), dtype=np.int64),
    }


def wham_api_record(person: Person) -> dict:
    record = wham_record(person)
    return {
        "poses_body": person.matrices[:, 1:],
        "poses_root_cam": person.matrices[:, :1],
        "betas": record["betas"],
        "verts_cam": record["verts"],
        "poses_root_world": person.matrices[:, :1],
        "trans_world": record["trans_world"],
        "frame_id": record["frame_ids"],
    }


def write_people(path: Path, people: dict, compress: int = 0) -> Path:
    joblib.dump(people, path, compress=compress)
    return path


def write_wham(path: Path, people: dict) -> Path:
    """A defaultdict whose ids are numpy.int64, as WHAM's are."""
    records = defaultdict(dict)
    for person, record in people.items():
        records[np.int64(person)] = record
    return write_people(path, records)


def phalp_frames(people: dict[int, Person], ghosts: dict[int, int] | None = None) -> dict:
    """Frames of ``results/demo_<video>.pkl``; ``ghosts``: frame -> person who is only predicted.

    Named from 1 as its frame extractor does; a first frame shows nobody, and is there all the same.
    """
    frames = {"outputs/_DEMO/v/img/000001.jpg": _phalp_frame(0)}
    count = max(map(len, people.values()))
    for row in range(count):
        frame = _phalp_frame(row + 1)
        for person, body in people.items():
            if row >= len(body):
                continue
            waited = 3 if (ghosts or {}).get(row) == person else 0
            translation = body.for_camera(5000 / 256 * 640)[row]
            frame["tid"].append(person)
            frame["tracked_time"].append(waited)
            frame["camera"].append((translation + (9.0 if waited else 0.0)).astype(np.float32))
            frame["size"].append([480, 640])
            frame["bbox"].append(np.zeros(4))
            frame["smpl"].append(
                {
                    "global_orient": body.matrices[row, :1],
                    "body_pose": body.matrices[row, 1:],
                    "betas": body.shapes()[row],
                }
            )
            if not waited:
                frame["tracked_ids"].append(person)
        frames[f"outputs/_DEMO/v/img/{row + 2:06d}.jpg"] = frame
    return frames


def _phalp_frame(time: int) -> dict:
    lists = ("tid", "bbox", "tracked_time", "tracked_ids", "smpl", "camera", "size")
    return {"time": time, "shot": 0, **{name: [] for name in lists}}


def write_gvhmr(path: Path, person: Person, focal_px: float = 800.0) -> Path:
    def tensor(values):
        return torch.tensor(np.asarray(values), dtype=torch.float32)

    in_camera = {
        "body_pose": tensor(person.pose[:, 1:22].reshape(len(person), 63)),
        "betas": tensor(person.shapes()),
        "global_orient": tensor(person.pose[:, 0]),
        "transl": tensor(person.for_camera(focal_px)),
    }
    K_full = torch.tensor([[focal_px, 0, 320], [0, focal_px, 240], [0, 0, 1.0]])
    content = {
        "smpl_params_global": {name: value * 0 for name, value in in_camera.items()},
        "smpl_params_incam": in_camera,
        "K_fullimg": K_full.repeat(len(person), 1, 1),
        "net_outputs": {"model_output": {"pred_context": torch.zeros(1, len(person), 2)}},
    }
    torch.save(content, path)
    return path


def write_tram_track(path: Path, person: Person, frames=None, focal_px: float = 700.0) -> Path:
    """``hps_track_<k>.npy``: an object array holding a dictionary of torch tensors."""
    frames = np.arange(len(person)) if frames is None else np.asarray(frames)
    content = {
        "pred_cam": torch.zeros(len(person), 3),
        "pred_pose": torch.zeros(len(person), 144),
        "pred_shape": torch.tensor(person.shapes()),
        "pred_rotmat": torch.tensor(person.matrices),
        "pred_trans": torch.tensor(person.for_camera(focal_px), dtype=torch.float32)[:, None],
        "frame": torch.tensor(frames),
    }
    np.save(path, content, allow_pickle=True)
    return path


def write_tram(folder: Path, people: list[Person], turned_deg: float = 0.0) -> Path:
    """``results/<video>``: camera.npy, tracks below hps, and files that nobody reads."""
    (folder / "hps").mkdir(parents=True)
    for k, person in enumerate(people):
        write_tram_track(folder / "hps" / f"hps_track_{k}.npy", person)
    turns = Rotation.from_euler(
        "y", np.linspace(0, turned_deg, 4)[:, None], degrees=True
    ).as_matrix()
    camera = {
        "pred_cam_R": turns.astype(np.float32),
        "pred_cam_T": np.zeros((4, 3), np.float32),
        "world_cam_R": turns.astype(np.float32),
        "world_cam_T": np.zeros((4, 3), np.float32),
        "img_focal": np.float64(700.0),
        "img_center": MIDDLE,
        "spec_focal": np.float64(650.0),
    }
    np.save(folder / "camera.npy", camera, allow_pickle=True)
    np.save(folder / "boxes.npy", np.array([np.zeros((1, 5))], object), allow_pickle=True)
    return folder


def romp_people(people: list[Person], row: int, meshes: bool = True, bev: bool = False) -> dict:
    """The dictionary of one frame, its people in the given order."""
    side, found = 640.0, defaultdict(list)
    for person in people:
        scale_px, origin_px = (part[row] for part in person.weak())
        t = 2 * (origin_px - MIDDLE) / side
        if bev:
            # BEV's bodies have their origin between the hips.
            translation = person.for_camera(side / 2 / np.tan(np.radians(30)))[row]
            translation = translation + person.hips[row]
            s = (1 / translation[2] - 1e-3) / np.tan(np.radians(30))
            lateral = translation[:2] / translation[2] / np.tan(np.radians(30))
            found["cam"].append([s, lateral[1], lateral[0]])
            found["cam_trans"].append(translation)
            found["smpl_betas"].append([*person.betas, 0.0])
        else:
            s = 2 * scale_px / side
            found["cam"].append([s, *t])
            # What ROMP writes without its meshes: crude, and of no use.
            found["cam_trans"].append(2 * np.array([*t, 1]) / s)
            found["smpl_betas"].append(person.betas)
        found["smpl_thetas"].append(person.pose[row].ravel())
        found["global_orient"].append(person.pose[row, 0])
        found["body_pose"].append(person.pose[row, 1:].ravel())
        found["pj2d_org"].append(np.zeros((71, 2)))
        if meshes:
            found["verts"].append(person.bodies[row] - (person.hips[row] if bev else 0))
    return {name: np.asarray(values, np.float32) for name, values in found.items()}


def write_romp(folder: Path, frames: dict[int, dict], video: bool = False) -> Path:
    """``<frame>.npz`` for each frame with people; ``video_results.npz`` beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, people in frames.items():
        np.savez(folder / f"{number:08d}.npz", results=people)
    if video:
        named = {f"{number:08d}.png": people for number, people in frames.items()}
        np.savez(folder / "video_results.npz", results=named, sequence_results={})
    return folder


def aist_motion(person: Person, scaling=98.0) -> dict:
    return {
        "smpl_loss": 1.8,
        "smpl_poses": person.pose.reshape(len(person), 72),
        "smpl_scaling": np.array([scaling], np.float32),
        "smpl_trans": (100 * person.translations).astype(np.float32),
    }


def easymocap_frames(person: Person) -> list[dict]:
    """Records with the root's rotation and translation about the world's origin."""
    still = person.pose.copy()
    still[:, 0] = 0
    bodies = posed_vertices(person.model, still, person.betas)
    records = []
    for row in range(len(person)):
        turn = Rotation.from_rotvec(person.pose[row, 0]).as_matrix()
        # The pelvis stays where the root's own rotation would leave it.
        Th = person.vertices[row, 0] - turn @ bodies[row, 0]
        records.append(
            {
                "Rh": person.pose[row, :1].astype(np.float32),
                "Th": Th[None].astype(np.float32),
                "poses": still[row].reshape(1, 72),
                "shapes": person.betas[None],
            }
        )
    return records


def write_zju(folder: Path, records: list[dict], first: int = 0) -> Path:
    folder.mkdir(parents=True)
    for number, record in enumerate(records, first):
        np.save(folder / f"{number}.npy", record, allow_pickle=True)
    return folder


def write_easymocap(folder: Path, records: list[dict], person: int = 0) -> Path:
    folder.mkdir(parents=True)
    for number, record in enumerate(records):
        plain = {name: value.tolist() for name, value in record.items()}
        (folder / f"{number:06d}.json").write_text(json.dumps([{"id": person, **plain}]))
    return folder
