"""What scoring can use. For the protocol alone: it must reach neither plan nor training."""

from __future__ import annotations

from mocoflow_core.capture.scene import Scene
from mocoflow_core.planning.decision import Decision


def decide_evaluation(scene: Scene) -> Decision:
    """Whether other cameras can be scored."""
    cameras = [name for name in scene.evaluation_cameras if scene.masks(name)]
    return Decision(
        name="evaluation_cameras",
        part="scoring",
        needed=bool(cameras),
        reason=f"{len(cameras)} other cameras have masks to score against"
        if cameras
        else "no other camera with masks: held-out frames of the train camera remain",
        evidence={"cameras": float(len(cameras))},
        threshold=1.0,
        saves="rendering and scoring the other cameras' views",
    )
