"""A blueprint for Rerun: what to show of a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import rerun.blueprint as rrb

STATE, PLAN = "/truck/state", "/truck/plan"
TYPES = {STATE: "truck_msgs.msg.TruckState", PLAN: "truck_msgs.msg.PlanState"}
# Views of curves: the topic, and its fields with their names.
CURVES = {
    "Speed, m/s": [
        (STATE, "speed_m_s", "driven"),
        (PLAN, "reference_speed_m_s", "reference"),
        (PLAN, "target_speed_m_s", "target"),
    ],
    "Engine power, W": [(STATE, "engine_power_w", "engine")],
    "Forces at the wheels, N": [
        (STATE, "drive_force_n", "drive"),
        (STATE, "brake_force_n", "brakes"),
        (STATE, "retarder_force_n", "retarder"),
    ],
    "Grade, rad": [(STATE, "grade_rad", "grade")],
    "Lateral error, m": [(PLAN, "lateral_error_m", "error")],
}
# Okabe and Ito: told apart by everybody.
COLORS = [(0, 114, 178), (230, 159, 0), (0, 158, 115)]


def rerun_blueprint() -> rrb.Blueprint:
    """What Rerun shows of a recording (`run.mcap`): curves of the truck and its plan, the map, the
    frames in space.

        tractrix.rerun_blueprint().save("tractrix", "truck.rbl")

    and then `rerun run.mcap truck.rbl`.

    Raises:
        ImportError: Rerun is missing (`pip install "tractrix[rerun]"`).
    """
    try:
        import rerun as rr
        import rerun.blueprint as rrb
        from rerun.blueprint.encodings import (
            ComponentSourceKind,
            VisualizerComponentMapping,
        )
    except ImportError as missing:
        hint = 'Rerun is needed: pip install "tractrix[rerun]"'
        raise ImportError(hint) from missing

    def view(name: str, curves: list[tuple[str, str, str]]) -> rrb.TimeSeriesView:
        lines: dict[str, list[rrb.Visualizer]] = {}
        for color, (topic, field, label) in zip(COLORS, curves, strict=False):
            source = VisualizerComponentMapping(
                target="Scalars:scalars",
                source_kind=ComponentSourceKind.SourceComponent,
                source_component=f"{TYPES[topic]}:message",
                selector=f".{field}",
            )
            line = rr.SeriesLines(colors=[color], names=[label])
            lines.setdefault(topic, []).append(line.visualizer(mappings=[source]))
        return rrb.TimeSeriesView(name=name, contents=list(lines), overrides=lines)

    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(name="Frames", contents=["/tf/**", "/tf_static/**"]),
                rrb.MapView(name="Place", contents=["/fix"]),
            ),
            rrb.Vertical(*(view(name, curves) for name, curves in CURVES.items())),
            column_shares=[1, 2],
        ),
        collapse_panels=True,
    )
