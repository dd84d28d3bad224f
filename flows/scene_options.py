"""Options of commands that reconstruct a scene."""

from __future__ import annotations

import typer

from flows.bounds import HIGHEST_SEED

SCENE_HELP = "Folder with a scene.json, or of a data set (see docs/datasets), or a video file."
MESHES_HELP = (
    "Body meshes to use instead: a file or folder of VIBE, PARE, WHAM, PHALP, 4D-Humans, GVHMR, "
    "TRAM, ROMP, BEV, AIST++ or EasyMocap, a folder of OBJ, PLY or GLB, or a meshes.npz."
)
PERSON_HELP = (
    "Id of the person among those of --meshes, by default the longest track; of a bare video its "
    "number, by default the only large one."
)
BODY_MODEL_HELP = "SMPL or SMPL-X model file, or a folder of them, where the meshes need one."
Seed = typer.Option(help="Of everything random.", min=0, max=HIGHEST_SEED)
# Written out: presets themselves take torch, which takes a second.
PRESET_HELP = "fast, toy, paper, paper_aist, paper_zju_mocap or paper_small."
