"""The formation in Foxglove's 3D panel: arrows, ways and labels. Needs the extra `foxglove`.

Axes of the scene point east, north and up; axes of an aircraft ahead, left and up.
"""

import math
from collections import deque
from collections.abc import Iterable

from foxglove.messages import (
    ArrowPrimitive,
    Color,
    FrameTransform,
    FrameTransforms,
    LinePrimitive,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    TextPrimitive,
    Timestamp,
    Vector3,
)

from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect

FRAME = "formation"
"""Frame of the scene, with the origin of the local frame."""

_WAY_S = 30.0
_WAY_POINTS = 150
_LENGTH_M = 12.0  # of an arrow: seen beside distances of tens of metres, not to scale
_WELL, _FAULTY, _WHITE = (
    Color(r=0.25, g=0.6, b=0.95, a=1.0),
    Color(r=0.95, g=0.3, b=0.25, a=1.0),
    Color(r=1.0, g=1.0, b=1.0, a=1.0),
)


class FormationScene:
    """The vehicles of a fleet, and the way that each has come in the last half minute."""

    def __init__(self) -> None:
        self._ways: dict[int, deque[tuple[float, Point3]]] = {}

    def update(self, states: Iterable[VehicleState]) -> tuple[SceneUpdate, FrameTransforms]:
        """Return what is to be drawn now, and a frame for each UAV, to follow it."""
        entities, transforms = [], []
        for state in states:
            attitude = state.latest.get(dialect.MAVLINK_MSG_ID_ATTITUDE)
            position, time_s = state.position_m, state.time_s
            if position is None or attitude is None or time_s is None:
                continue
            north, east, down = position
            rotation = orientation(attitude.roll, attitude.pitch, attitude.yaw)
            at = Vector3(x=east, y=north, z=-down)
            stamp = Timestamp.from_epoch_secs(time_s)
            frame = f"uav{state.system}"
            transforms.append(
                FrameTransform(
                    timestamp=stamp,
                    parent_frame_id=FRAME,
                    child_frame_id=frame,
                    translation=at,
                    rotation=rotation,
                )
            )
            entities.append(
                self._entity(state, frame, stamp, Pose(position=at, orientation=rotation))
            )
        return SceneUpdate(entities=entities), FrameTransforms(transforms=transforms)

    def _entity(self, state: VehicleState, frame: str, stamp: Timestamp, pose: Pose) -> SceneEntity:
        faults = "; ".join(fault.describe() for fault in state.active_faults)
        color = _FAULTY if faults else _WELL
        label = f"UAV {state.system}" + (f": {faults}" if faults else "")
        return SceneEntity(
            timestamp=stamp,
            frame_id=FRAME,
            id=frame,
            arrows=[
                ArrowPrimitive(
                    pose=pose,
                    shaft_length=0.7 * _LENGTH_M,
                    shaft_diameter=0.1 * _LENGTH_M,
                    head_length=0.3 * _LENGTH_M,
                    head_diameter=0.25 * _LENGTH_M,
                    color=color,
                )
            ],
            lines=[
                LinePrimitive(
                    thickness=2.0, scale_invariant=True, points=self._way(state), color=color
                )
            ],
            texts=[
                TextPrimitive(
                    pose=pose,
                    billboard=True,
                    font_size=14.0,
                    scale_invariant=True,
                    color=_WHITE,
                    text=label,
                )
            ],
        )

    def _way(self, state: VehicleState) -> list[Point3]:
        """Return where a vehicle has been, oldest first, its present place included."""
        way = self._ways.setdefault(state.system, deque(maxlen=_WAY_POINTS))
        time_s, position = state.time_s, state.position_m
        assert time_s is not None
        assert position is not None
        if way and time_s < way[-1][0]:  # it was started again
            way.clear()
        north, east, down = position
        here = Point3(x=east, y=north, z=-down)
        if not way or time_s - way[-1][0] >= _WAY_S / _WAY_POINTS:
            way.append((time_s, here))
        while way[0][0] < time_s - _WAY_S:
            way.popleft()
        return [*(point for _, point in way), here]


def orientation(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the rotation from ahead, left, up to east, north, up.

    Args:
        roll: Of the aircraft, as ATTITUDE has it [rad].
        pitch: Positive: nose up [rad].
        yaw: From north, positive to the east [rad].
    """
    a, b, c = 0.5 * roll, -0.5 * pitch, 0.5 * (0.5 * math.pi - yaw)
    sa, ca, sb, cb, sc, cc = (f(x) for x in (a, b, c) for f in (math.sin, math.cos))
    return Quaternion(
        x=sa * cb * cc - ca * sb * sc,
        y=ca * sb * cc + sa * cb * sc,
        z=ca * cb * sc - sa * sb * cc,
        w=ca * cb * cc + sa * sb * sc,
    )
