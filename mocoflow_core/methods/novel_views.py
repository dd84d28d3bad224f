"""Any view of a finished run: any camera, any time, any background, as pictures or a video."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageColor
from pydantic import BaseModel, ConfigDict

from mocoflow_core.errors import InputError
from mocoflow_core.geometry.camera import Camera
from mocoflow_core.geometry.orbit import moved_around
from mocoflow_core.io.full_disk import full_disk_is_bad_input
from mocoflow_core.io.pictures import as_bytes, read_picture, write_picture
from mocoflow_core.io.run_folder import RunRecord
from mocoflow_core.io.video import write_video
from mocoflow_core.methods.presentation import orbit
from mocoflow_core.methods.run_clip import RunClip
from mocoflow_core.progress import Progress
from mocoflow_core.rendering.trained_scene import TrainedScene
from mocoflow_core.threads import torch_threads

ORBIT = "orbit"
VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv")


class ViewRequest(BaseModel):
    """Which views are wanted. Without frames, times or fps: the clip at its working rate.

    Beside frames or times, ``fps`` is the rate of the video that they are put into.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    camera: str
    frames: tuple[int, ...] = ()  # source numbers
    times_s: tuple[float, ...] = ()  # seconds since the clip's first frame
    fps: float | None = None
    background: str = "white"  # a colour's name or code, or a picture's path
    rotate: tuple[float, float, float] | None = None  # world axis times radians, of the person
    longer_side_px: int | None = None


class Shot(NamedTuple):
    """One picture to take; ``number`` names its file."""

    number: int
    time: float  # normalised
    camera: Camera


def render_novel_views(
    run: RunRecord, trained: Path, request: ViewRequest, out: Path, progress: Progress
) -> int:
    """Write a video, one PNG, or a folder of ``%06d.png``; give the number of pictures.

    Frames are named by their source number, other times by their position. Raises InputError for
    an unknown camera, two choices of times, a time outside the clip, a background that is neither
    colour nor picture, and a full disk.
    """
    _require_one_choice(request, out)
    scene = TrainedScene.open(trained)
    shots = _shots(run, scene, request)
    background = _background(request.background, shots[0].camera)
    # More than one thread only where the optimisation has measured that it pays.
    with torch_threads(1), full_disk_is_bad_input(str(out)):
        pictures = _pictures(scene, shots, background, progress)
        _write(pictures, len(shots), out, request.fps or RunClip.of(run).fps)
    return len(shots)


def _write(
    pictures: Iterator[tuple[Shot, NDArray[np.uint8]]], count: int, out: Path, fps: float
) -> None:
    if _is_video(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        write_video(out, (picture for _, picture in pictures), fps)
    elif out.suffix.lower() == ".png":
        if count > 1:
            raise InputError("One .png holds one view", f"{count} views", "Give a folder or .mp4.")
        write_picture(out, next(pictures)[1])
    else:
        for shot, picture in pictures:
            write_picture(out / f"{shot.number:06d}.png", picture)


def _pictures(
    scene: TrainedScene, shots: list[Shot], background: NDArray[np.float32], progress: Progress
) -> Iterator[tuple[Shot, NDArray[np.uint8]]]:
    for done, shot in enumerate(shots):
        rgb, _ = scene.render(shot.camera, shot.time, background)
        progress((done + 1) / len(shots), f"view {done + 1} of {len(shots)}")
        yield shot, as_bytes(rgb)


def _shots(run: RunRecord, scene: TrainedScene, request: ViewRequest) -> list[Shot]:
    clip = RunClip.of(run)
    moments = _moments(clip, request)
    times = np.array([time for _, time in moments])
    if request.camera == ORBIT:
        first = _camera(run, run.train_camera, request.longer_side_px)
        cameras = list(orbit(scene, first, clip.up, times))
    else:
        cameras = [_camera(run, request.camera, request.longer_side_px)] * len(moments)
    if request.rotate is not None:
        # Turning the person is moving the camera the other way round the person.
        turn = -np.array(request.rotate)
        cameras = [
            moved_around(camera, turn, scene.space.centre_at(time))
            for camera, time in zip(cameras, times, strict=True)
        ]
    return [
        Shot(number, time, camera) for (number, time), camera in zip(moments, cameras, strict=True)
    ]


def _require_one_choice(request: ViewRequest, out: Path) -> None:
    """Raise InputError where one choice of times would have to be ignored for another."""
    if request.frames and request.times_s:
        raise InputError("One choice of times", "--frames and --times", "Leave one of them out.")
    listed = "--frames" if request.frames else "--times" if request.times_s else ""
    if listed and request.fps is not None and not _is_video(out):
        raise InputError(
            f"--fps beside {listed} is the rate of a video",
            out.name,
            f"Give an .mp4, or leave out --fps or {listed}.",
        )


def _is_video(out: Path) -> bool:
    return out.suffix.lower() in VIDEO_SUFFIXES


def _moments(clip: RunClip, request: ViewRequest) -> list[tuple[int, float]]:
    """Numbers for the files, and normalised times."""
    if request.times_s:
        found = [(row, clip.time_of_second(s)) for row, s in enumerate(request.times_s)]
    elif request.frames or request.fps is None:
        frames = request.frames or clip.working_frames()
        found = [(frame, clip.time(frame)) for frame in frames]
    else:
        count = int(clip.duration_s * request.fps) + 1
        found = [(row, clip.time_of_second(row / request.fps)) for row in range(count)]
    clip.require_inside(time for _, time in found)
    return found


def _camera(run: RunRecord, name: str, longer_side_px: int | None) -> Camera:
    values = run.cameras.get(name)
    if not isinstance(values, dict):
        known = ", ".join([ORBIT, *run.cameras])
        raise InputError(f"--camera must be one of {known}", repr(name), "Choose one.")
    camera = Camera.from_json(name, values)  # type: ignore[arg-type]
    if longer_side_px is None:
        return camera
    scale = longer_side_px / max(camera.width, camera.height)
    return camera.resized(round(scale * camera.width), round(scale * camera.height))


def _background(name: str, camera: Camera) -> NDArray[np.float32]:
    """(H, W, 3) in [0, 1]; a picture is resized to the camera."""
    size = (camera.height, camera.width, 3)
    if Path(name).is_file():
        picture = Image.fromarray(read_picture(Path(name))).convert("RGB")
        return np.asarray(picture.resize((camera.width, camera.height)), np.float32) / 255.0
    try:
        colour = ImageColor.getrgb(name)[:3]
    except ValueError as error:
        raise InputError(
            "--background must be a colour or a picture", repr(name), "Try white or #204060."
        ) from error
    return np.broadcast_to(np.asarray(colour, np.float32) / 255.0, size).copy()
