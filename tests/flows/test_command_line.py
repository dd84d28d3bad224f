"""The command line: exit codes, one-line reasons, and how it treats folders."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows.command_line import main
from mocoflow_core.io.video import VideoDescription, describe_video
from tests.flows.stages import STAGES

ROOT = Path(__file__).parents[2]


def mocoflow(*arguments, timeout=300):
    return subprocess.run(
        [sys.executable, "-c", "from flows.command_line import main; main()", *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )


def one_line_because(errors, reason):
    assert len(errors.strip().splitlines()) == 1, errors
    assert reason in errors


@pytest.fixture
def command(monkeypatch, capsys):
    """The same in this process, which has loaded everything already."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["mocoflow", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        return subprocess.CompletedProcess(arguments, ended.value.code, said.out, said.err)

    return run


@pytest.fixture
def refuse(command):
    """Runs it, and expects exit code 2 with one line on stderr that names the reason."""

    def run(*arguments, because):
        done = command(*arguments)
        assert done.returncode == 2, done.stderr
        one_line_because(done.stderr, because)

    return run


@pytest.fixture
def scene(toy_scene, tmp_path):
    return shutil.copytree(toy_scene, tmp_path / "scene")


@pytest.fixture
def describe(scene):
    """Changes scene.json."""

    def change(edit):
        description = json.loads((scene / "scene.json").read_text())
        edit(description)
        (scene / "scene.json").write_text(json.dumps(description))

    return change


def test_help_is_instant():
    start = time.perf_counter()
    assert mocoflow("--help").returncode == 0
    assert time.perf_counter() - start < 3.0  # Below 0.3 s alone; the tests share their machine.


def test_help_loads_neither_torch_nor_prefect():
    code = "import sys, flows.command_line; print({'torch', 'prefect', 'numpy'} & set(sys.modules))"
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == "set()"


def test_an_unknown_field_is_refused_with_the_closest_one(refuse, toy_scene, tmp_path):
    refuse(
        *("reconstruct", toy_scene, "--out", tmp_path / "out", "--set", "schedule.fine_step=3"),
        because="schedule.fine_steps",
    )


def test_a_value_that_its_field_refuses_is_named(refuse, toy_scene, tmp_path):
    refuse(
        *("reconstruct", toy_scene, "--out", tmp_path / "out", "--set", "schedule.rays=0"),
        because="schedule.rays",
    )


def test_a_folder_that_holds_something_else_is_refused_and_left_alone(refuse, toy_scene, tmp_path):
    (tmp_path / "thesis.txt").write_text("precious")
    refuse("reconstruct", toy_scene, "--out", tmp_path, because="something else")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_folder_of_other_settings_is_refused(refuse, first_run, toy_scene, store_url):
    out, _ = first_run
    refuse(
        *("reconstruct", toy_scene, "--preset", "toy", "--store", store_url),
        *("--out", out, "--seed", 7),
        because="another run",
    )


def test_a_finished_folder_is_found_finished(command, first_run, toy_scene, store_url):
    out, _ = first_run
    run = command(
        *("reconstruct", toy_scene, "--preset", "toy", "--store", store_url, "--out", out)
    )
    assert run.returncode == 0, run.stderr
    assert "Already finished" in run.stdout


def test_a_scene_that_is_not_there_is_refused(refuse, tmp_path):
    refuse("reconstruct", tmp_path / "nothing", "--out", tmp_path / "out", because="scene.json")


def test_a_preset_that_does_not_exist_is_refused(refuse, toy_scene, tmp_path):
    refuse(
        "reconstruct", toy_scene, "--preset", "fats", "--out", tmp_path / "out", because="fast, toy"
    )


@pytest.mark.parametrize(
    ("condition", "because"),
    [
        ("30", "train_psnr=DECIBELS"),
        ("train_psnr", "train_psnr=DECIBELS"),
        ("psnr=30", "only pixels of the train camera"),
        ("train_psnr=much", "decibels above 0"),
        ("train_psnr=-3", "decibels above 0"),
        ("train_psnr=nan", "decibels above 0"),
        ("train_psnr=300", "schedule.until_train_psnr"),
    ],
)
def test_a_score_that_cannot_be_reached_is_refused(refuse, toy_scene, tmp_path, condition, because):
    refuse(
        *("reconstruct", toy_scene, "--out", tmp_path / "out", "--until", condition),
        because=because,
    )


def test_a_matrix_that_is_no_rotation_is_refused(refuse, scene, describe, tmp_path):
    describe(lambda d: d["cameras"]["cam00"]["R"][0].reverse())
    refuse("reconstruct", scene, "--out", tmp_path / "out", because="rotation")


def test_a_missing_mesh_file_is_refused(refuse, toy_scene, tmp_path):
    refuse(
        *("reconstruct", toy_scene, "--out", tmp_path / "out", "--meshes", tmp_path / "no.npz"),
        because="--meshes",
    )


def test_a_missing_body_model_is_refused(refuse, toy_scene, tmp_path):
    refuse("plan", toy_scene, "--body-model", tmp_path / "no.pkl", because="--body-model")


def test_a_person_of_meshes_without_people_is_bad_input(toy_scene, refuse_inside_the_flow):
    refuse_inside_the_flow(toy_scene, "meshes.person needs", settings=("meshes.person=3",))


@pytest.fixture
def refuse_inside_the_flow(reconstruct, tmp_path):
    """Runs the flow in this process, which is quicker: the same error, before it gets printed."""
    from mocoflow_core.errors import InputError

    def run(scene, because, **changes):
        store = tmp_path / "fresh"
        with pytest.raises(InputError, match=because):
            reconstruct(scene, tmp_path / "out", store=str(store), **changes)
        # Sound parts may have been read, but nothing is built on a damaged scene.
        done = {manifest.parent.parent.name for manifest in store.glob("*/*/manifest.json")}
        assert done <= set(STAGES[: STAGES.index("repair_body")])
        # What file names show is found before a folder is taken.
        record = tmp_path / "out" / "run.json"
        assert not record.exists() or not json.loads(record.read_text())["finished"]

    return run


def with_a_mask_of_another_size(scene, describe):
    Image.new("L", (16, 16), 255).save(scene / "masks" / "cam00" / "000002.png")


def with_a_missing_frame(scene, describe):
    (scene / "frames" / "cam00" / "000003.png").unlink()


def with_a_video_that_cannot_be_decoded(scene, describe):
    (scene / "broken.mp4").write_bytes(b"no video at all" * 100)
    describe(lambda d: d["cameras"]["cam00"].update(frames="broken.mp4"))


def edit_meshes(scene, edit):
    with np.load(scene / "meshes.npz") as file:
        arrays = {name: file[name] for name in file.files}
    edit(arrays)
    np.savez(scene / "meshes.npz", **arrays)


def with_meshes_with_nan(scene, describe):
    edit_meshes(scene, lambda a: a["vertices"].__setitem__((0, 0, 0), np.nan))


def with_meshes_of_another_frame_count(scene, describe):
    def edit(arrays):
        arrays["vertices"] = arrays["vertices"][:3]
        arrays["frame_indices"] = arrays["frame_indices"][:3]

    edit_meshes(scene, edit)


def with_meshes_in_millimetres(scene, describe):
    edit_meshes(scene, lambda a: a.update(vertices=1000 * a["vertices"]))


@pytest.mark.parametrize(
    ("damage", "because"),
    [
        (with_a_mask_of_another_size, r"mask 000002\.png of cam00 .* got 16 x 16"),
        (with_a_missing_frame, "no frame 3 .1 missing"),
        (with_a_video_that_cannot_be_decoded, r"broken\.mp4 must be a video"),
        (with_meshes_with_nan, "finite, got 1 that are not, the first at frame 0, vertex 0"),
        (with_meshes_of_another_frame_count, "3 meshes for 8 frames"),
        (with_meshes_in_millimetres, "Likely millimetres: multiply the vertices by 0.001"),
    ],
)
def test_a_damaged_scene_is_bad_input(damage, because, scene, describe, refuse_inside_the_flow):
    damage(scene, describe)
    refuse_inside_the_flow(scene, because)


def test_bad_input_found_by_a_stage_ends_with_exit_code_2(
    refuse, prefect_server, scene, describe, tmp_path
):
    with_meshes_in_millimetres(scene, describe)
    places = ("--out", tmp_path / "out", "--store", tmp_path / "store")
    reason = "Likely millimetres: multiply the vertices by 0.001"
    refuse("reconstruct", scene, "--preset", "toy", *places, because=reason)


def test_the_same_render_command_gives_the_same_picture(command, first_run, tmp_path):
    out, _ = first_run
    pictures = [tmp_path / f"{number}.png" for number in range(2)]
    for run, picture in zip((mocoflow, command), pictures, strict=True):
        asked = ("render", out, "--camera", "cam01", "--times", "0.11", "--out", picture)
        assert run(*asked).returncode == 0
    assert pictures[0].read_bytes() == pictures[1].read_bytes()


def test_a_rendered_frame_is_the_scored_view(command, first_run, tmp_path):
    out, _ = first_run
    done = command("render", out, "--camera", "cam01", "--frames", "3", "--out", tmp_path / "v")
    assert done.returncode == 0, done.stderr
    rendered = (tmp_path / "v" / "000003.png").read_bytes()
    assert rendered == (out / "views" / "cam01" / "000003.png").read_bytes()


@pytest.mark.parametrize(
    ("option", "value", "because"),
    [
        ("--camera", "cam09", "cam01"),
        ("--frames", "100", "in the clip"),
        ("--frames", "one", "numbers"),
        ("--background", "colour of the sky", "--background"),
        ("--rotate", "1,2", "Three numbers"),
    ],
)
def test_a_view_that_cannot_be_is_refused(refuse, first_run, tmp_path, option, value, because):
    out, _ = first_run
    refuse("render", out, option, value, "--out", tmp_path / "views", because=because)


def test_a_choice_of_times_is_never_ignored_for_another(refuse, first_run, tmp_path):
    out, _ = first_run
    frames, times, fps = ("--frames", "2"), ("--times", "0.1"), ("--fps", "5")
    views = ("--out", tmp_path / "views")
    refuse("render", out, *frames, *times, *views, because="--frames and --times")
    refuse("render", out, *frames, *fps, *views, because="--fps beside --frames")
    refuse("render", out, *times, *fps, *views, because="--fps beside --times")
    assert not list(tmp_path.iterdir())


def test_fps_beside_frames_is_the_rate_of_the_video(command, first_run, tmp_path):
    out, _ = first_run
    video = tmp_path / "views.mp4"
    run = command("render", out, "--frames", "2,4,5", "--fps", "5", "--out", video)
    assert run.returncode == 0, run.stderr
    assert describe_video(video) == VideoDescription(fps=5.0, frame_count=3)


@pytest.mark.parametrize("name", ["views.mp4", "view.png"])
def test_a_full_disk_leaves_no_half_of_a_view(refuse, first_run, tmp_path, name):
    out, _ = first_run
    (tmp_path / f".new.{name}").symlink_to("/dev/full")
    refuse("render", out, "--frames", "3", "--out", tmp_path / name, because="full disk")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("out", "wanted"), [("body.glb", "glb"), ("plys", "ply")])
def test_a_run_is_exported_as_meshes(command, first_run, tmp_path, out, wanted):
    run, _ = first_run
    spacing = ("--spacing-m", "0.04")
    done = command(
        *("export", run, "--format", wanted, "--frames", "2,4-5", *spacing, "--out", tmp_path / out)
    )
    assert done.returncode == 0, done.stderr
    assert "vertices" in done.stdout
    files = [path.name for path in sorted((tmp_path / out).glob("*.ply"))]
    assert files == ["000002.ply", "000004.ply", "000005.ply", "canonical.ply"] * (wanted == "ply")
    assert (tmp_path / out).exists()


@pytest.mark.parametrize(
    ("option", "value", "because"),
    [
        ("--format", "obj", "--format"),
        ("--format", "ply", "a folder"),
        ("--frames", "100", "in the clip"),
        ("--frames", "one", "numbers"),
    ],
)
def test_meshes_that_cannot_be_are_refused(refuse, first_run, tmp_path, option, value, because):
    run, _ = first_run
    refuse("export", run, option, value, "--out", tmp_path / "body.glb", because=because)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_no_half_of_a_mesh(refuse, first_run, tmp_path):
    run, _ = first_run
    (tmp_path / ".new.body.glb").symlink_to("/dev/full")
    wanted = ("--frames", "3", "--spacing-m", "0.04", "--out", tmp_path / "body.glb")
    refuse("export", run, *wanted, because="full disk")
    assert not list(tmp_path.iterdir())


def test_a_run_that_is_not_finished_is_not_exported(refuse, first_run, tmp_path):
    run, _ = first_run
    record = json.loads((run / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps(record | {"finished": False}))
    refuse("export", tmp_path, "--out", tmp_path / "a.glb", because="an unfinished one")


def test_rendering_a_folder_without_a_run_is_refused(refuse, tmp_path):
    refuse("render", tmp_path, "--out", tmp_path / "views", because="run.json")


def test_a_plan_prepares_a_scene_for_the_run_that_follows(
    command, toy_scene, reconstruct, tmp_path
):
    store = tmp_path / "store"
    done = command("plan", toy_scene, "--preset", "toy", "--store", store)
    assert done.returncode == 0
    printed = done.stdout
    for words in ("What the preparation needs", "What the optimisation needs", "motion residual"):
        assert words in printed
    record = reconstruct(toy_scene, tmp_path / "out", store=str(store))
    before = [stage for stage in record.stages if stage.cached]
    assert [stage.name for stage in before] == STAGES[: STAGES.index("optimise_scene")]


def test_a_plan_refuses_what_a_reconstruction_refuses(refuse, toy_scene, tmp_path):
    refuse("plan", toy_scene, "--set", "plan.motion_residue=off", because="plan.motion_residual")
    refuse("plan", tmp_path / "nothing", because="scene.json")
