"""Stage extract_clip: what the train camera saw, at the working size and rate."""

from __future__ import annotations

from mocoflow_core.artifacts import ClipArtifact, MeshArtifact
from mocoflow_core.body.facing import frames_that_show, turned_away_warning
from mocoflow_core.capture import extract
from mocoflow_core.capture.composite import composite_clip
from mocoflow_core.capture.extract import CaptureConfig, ClipNeeds
from mocoflow_core.capture.scene import open_scene
from mocoflow_core.capture.shadows import shadowed_area
from mocoflow_core.capture.strange_frames import sound_clip
from tasks.source import Source
from tasks.stage import Stage, Summary, stage

ALGORITHM_VERSION = 5  # Half covered pixels stay before the plate.
# About the shares of its time.
EXTRACTED, CHECKED = 0.6, 0.75


@stage(ClipArtifact, ALGORITHM_VERSION)
def extract_clip(
    work: Stage,
    recording: Source,
    capture: CaptureConfig,
    needs: ClipNeeds,
    bodies: MeshArtifact | None = None,
) -> Summary:
    """Frames, masks, background and camera of the train side (MoCo-Flow sec. 4, data).

    With ``bodies`` only the frames whose body is turned as ``capture.least_shown`` asks for.
    Output: ``clip.json`` and an ``.npy`` file for each array of the clip. A few seconds.
    """
    scene = open_scene(recording.path, recording.train_camera)
    only = bodies and frames_that_show(work.open(bodies), scene, capture.least_shown)
    progress = work.part(0.0, EXTRACTED)
    extracted = extract.extract_clip(scene, capture, needs, only, progress)
    checking = work.part(EXTRACTED, CHECKED)
    sound, warnings = sound_clip(extracted, capture.difference_threshold, checking)
    mask_files = {} if needs.masks else scene.masks(scene.train_camera)
    behind_person = capture.behind(scene)
    composing = work.part(CHECKED, 1.0)
    clip = composite_clip(scene, sound, behind_person, mask_files, composing)
    selected, every = (
        len(extract.select_training_frames(scene, capture, some).all) for some in (only, None)
    )
    away = turned_away_warning(selected, every, capture.least_shown)
    clip.save(work.folder)
    return {
        "frames": len(clip.frame_indices),
        "repeated": selected - len(extracted.frame_indices),
        "held_out": int(clip.held_out.sum()),
        "first_frame": int(clip.frame_indices[0]),
        "last_frame": int(clip.frame_indices[-1]),
        "fps": clip.fps,
        "source_fps": scene.description.fps,
        "up": scene.up.tolist(),
        "camera": {"name": clip.camera.name, **clip.camera.to_json()},
        "behind_person": behind_person,
        "shadowed": shadowed_area(sound),
        "warnings": [*clip.remarks, *warnings, *away],
    }
