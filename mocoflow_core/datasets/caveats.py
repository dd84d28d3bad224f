"""What scores on a data set must be read with: printed at the import, and on every report."""

from __future__ import annotations

from mocoflow_core.datasets.dataset_scene import DatasetMeshes


def of_multi_view_bodies(meshes: DatasetMeshes | None) -> tuple[str, ...]:
    """Bodies that were fitted to the very views that are scored."""
    if meshes is None:
        return ()
    return (
        f"the scene's own bodies, {meshes.source}, were fitted to the evaluation cameras' pictures "
        "too: scores compare with those of monocular methods only where an estimate from the train "
        "camera's video is given with --meshes",
    )


def of_masks_near(meshes: DatasetMeshes | None) -> tuple[str, ...]:
    """Masks that were looked for near the bodies, those of the evaluation cameras among them."""
    if meshes is None:
        return ()
    return (
        "the masks that are scored against were looked for near the scene's own bodies and hold "
        "their inside: mask_iou and psnr_union favour these bodies; a segmenter's masks, given at "
        "the import with the field masks, favour none",
    )
