"""The layout of Foxglove for a fleet: formation in 3D, tracking, triggers, faults and texts.

Needs the extra `foxglove`.
"""

from collections.abc import Iterable, Sequence

import foxglove.layouts as fl

from gcs.fleet.foxglove.scene import FRAME
from gcs.results.channels import EVENT, FAULTS, TEXTS
from gcs.results.quantities import QUANTITIES
from mavlink_defs.constants import ACTUATORS


def layout_of(systems: Sequence[int]) -> str:
    """Return the layout of a fleet with these system ids, as a file that Foxglove imports."""
    formation = fl.ThreeDeePanel(
        title="Formation",
        config=fl.ThreeDeeConfig(
            fixed_frame=FRAME,
            follow_tf=f"uav{systems[0]}",
            follow_mode="follow-position",
            enu_frame_id=FRAME,
            camera_state=fl.ThreeDeeCameraState(distance=150.0, phi=60.0, theta_offset=45.0),
            topics={"/formation": fl.BaseRendererSceneUpdateTopicSettings(visible=True)},
            layers={"grid": fl.BaseRendererGridLayerSettings()},
        ),
    )
    texts = fl.LogPanel(title="Texts", config=fl.LogConfig(topic_to_render=TEXTS.topic(0)))
    left = _column([(2.0, formation), (1.0, texts)])
    tracking = [(1.0, _tracking(systems, name)) for name in QUANTITIES]
    right = _column([*tracking, (1.0, _triggers(systems)), (1.5, _faults(systems))])
    items = [fl.SplitItem(proportion=1.0, content=side) for side in (left, right)]
    return fl.Layout(content=fl.SplitContainer(direction="row", items=items)).to_json()


def _column(panels: Iterable[tuple[float, fl.BasePanel]]) -> fl.SplitContainer:
    items = [fl.SplitItem(proportion=share, content=panel) for share, panel in panels]
    return fl.SplitContainer(direction="column", items=items)


def _tracking(systems: Sequence[int], name: str) -> fl.PlotPanel:
    unit = "m/s" if name == "airspeed" else "rad"
    series = [
        fl.PlotSeries(value=f"/uav{system}/state.error_{name}", label=f"UAV {system}")
        for system in systems
    ]
    title = f"Tracking error, {name} [{unit}]"
    return fl.PlotPanel(title=title, config=fl.PlotConfig(paths=series, show_legend=True))


def _triggers(systems: Sequence[int]) -> fl.PlotPanel:
    series = [
        fl.PlotSeries(
            value=f'{EVENT.topic(system)}{{actuator=="{actuator}"}}.count',
            label=f"UAV {system}, {actuator}",
        )
        for system in systems
        for actuator in ACTUATORS
    ]
    return fl.PlotPanel(title="Events so far", config=fl.PlotConfig(paths=series))


def _faults(systems: Sequence[int]) -> fl.StateTransitionsPanel:
    series = [
        fl.StateTransitionsSeries(
            value=f"{FAULTS.topic(system)}.{actuator}", label=f"UAV {system}, {actuator}"
        )
        for system in systems
        for actuator in ACTUATORS
    ]
    return fl.StateTransitionsPanel(title="Faults", config=fl.StateTransitionsConfig(paths=series))
