"""`report.html`: a run's figures, charts and pictures in one file that needs nothing else.

Made from the run's folder alone; where the scene's true look is at hand, held-out views are shown, otherwise
keyframes.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from hgs_core.errors import MapError
from hgs_core.evaluation.colour_maps import colourise, colourise_depth, colourise_log
from hgs_core.evaluation.error_prediction import ErrorPredictors
from hgs_core.evaluation.html_page import group, heading, page, paragraph, picture, table
from hgs_core.evaluation.line_chart import Series, line_chart
from hgs_core.evaluation.report import MissionReport
from hgs_core.evaluation.top_view import top_view
from hgs_core.evaluation.trajectory import read_trajectory
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.ply import read_ply
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mapping.transforms import TRANSFORMS
from hgs_core.mission.config import MissionConfig
from hgs_core.mission.event_series import EventSeries, read_event_series
from hgs_core.mission.shown_views import KeyframeViews, ShownView, held_out_views, keyframe_views
from hgs_core.scene.ray_caster import RayCaster

REPORT_PAGE: Final = "report.html"
_LARGEST_ERROR: Final = 0.15
"""Colour error that is drawn brightest; colours are 0..1."""

_REASONS: Final = {
    "unreachable": "no way leads to a place from which it could be seen",
    "below_threshold": "what a view of it would gain is too little to go there",
    "occluded": "something stands before it from wherever the robot can go",
    "out_of_bounds": "outside the region to explore",
    "time_limit": "the time was up before it was its turn",
    "interrupted": "the mission was stopped before it was its turn",
}


def write_report_page(
    folder: Path,
    config: MissionConfig,
    *,
    caster: RayCaster | None,
    progress: Callable[[str], None] | None = None,
) -> None:
    """Write `report.html` into a run's folder, whole or not at all (temporary file, then rename).

    `caster` shows the true scene; None where there is none. Raises an `HgsError` naming a file of the run
    that is missing or damaged.
    """

    def say(message: str) -> None:
        if progress is not None:
            progress(message)

    report = MissionReport.read(folder / "report.json")
    series = read_event_series(folder / "events.jsonl")
    gaussians = read_ply(folder / "map.ply")
    title = f"{report.scene}: {report.planner}, seed {report.seed}"
    ended = report.stop_reason.replace("_", " ")
    body = [
        heading(title, 1),
        paragraph(f"Ended: {ended}. {report.stop_message.capitalize()}.".replace("..", "."), "lead"),
        heading("Key figures"),
        table(("figure", "value", "what it is"), _key_figures(report)),
    ]
    say("report page: the map from above")
    body += _from_above(gaussians, folder)
    body += [heading("Over the mission"), group("grid2", _completion_charts(report) + _charts(series))]
    body += _unseen(report)
    say("report page: views")
    body += _views(folder, config, report, gaussians, caster)
    content = page(title, body)
    partial = folder / f".{REPORT_PAGE}.{os.getpid()}.partial"
    partial.write_text(content, encoding="utf-8")
    partial.replace(folder / REPORT_PAGE)


def _key_figures(report: MissionReport) -> list[tuple[str, str, str]]:
    observable = report.completion_ratio_observable
    return [
        ("path", _number(report.path_length_m, 1, "m"), f"driven; {report.collisions} collisions"),
        (
            "mission time",
            _number(report.sim_time_s, 0, "s"),
            f"{_number(report.wall_s, 0, 's')} of wall time",
        ),
        ("frames", str(report.frames), f"integrated, {report.keyframes} of them kept as keyframes"),
        ("Gaussians", f"{report.n_gaussians:,}", "in the final map"),
        (
            "accuracy",
            _number(report.accuracy_cm, 2, "cm"),
            "mean distance of the Gaussians to the true surface",
        ),
        (
            "accuracy of the mesh",
            _number(report.accuracy_cm_mesh, 2, "cm"),
            "the same of mesh.ply's vertices",
        ),
        (
            "completion",
            _number(report.completion_cm_observable, 2, "cm"),
            "mean distance of the true surface to the map, of what a reachable camera can see",
        ),
        ("completion ratio", _number(observable, 3), "share of that surface with the map within 5 cm"),
        ("PSNR", _number(report.psnr_db, 1, "dB"), "held-out views, where some frame had seen the surface"),
        ("SSIM", _number(report.ssim, 3), "structural similarity of the same views"),
        ("median depth error", _number(report.median_depth_error_cm, 2, "cm"), "of the same views"),
        (
            "T_P",
            _number(report.planning_s.median, 3, "s"),
            f"planning cycle, median of {report.planning_cycles}; 95 % below "
            f"{_number(report.planning_s.p95, 3, 's')}",
        ),
        ("mapping", _number(report.mapping_s_per_frame, 3, "s"), "wall time for a frame, mean"),
        (
            "real-time factor",
            _number(report.real_time_factor, 2),
            "mission time / time busy with mapping and planning: 1 keeps pace with the robot",
        ),
        ("peak memory", _number(report.peak_rss_mib, 0, "MiB"), "of the mission's process"),
    ]


def _from_above(gaussians: GaussianMap, folder: Path) -> list[str]:
    positions = read_trajectory(folder / "trajectory.txt").poses.translation
    try:
        image = top_view(gaussians, positions)
    except MapError as error:
        return [heading("From above"), paragraph(f"Nothing to draw: {error}.")]
    caption = "The map from above, cut off at 2 m, and the way that the robot drove."
    return [heading("From above"), picture(image, caption)]


def _charts(series: EventSeries) -> list[str]:
    path, time, share = series.path_length_m, series.time_s, 100.0 * series.observed_share
    volume = series.observed_volume_m3

    def chart(title: str, x: np.ndarray, y: np.ndarray, x_label: str, y_label: str) -> str:
        return line_chart(title, [Series(name=title, x=x, y=y)], x_label=x_label, y_label=y_label)

    return [
        chart("Observed volume over the path", path, volume, "path [m]", "m³"),
        chart("Observed volume over time", time, volume, "mission time [s]", "m³"),
        chart("Observed, of observed and known to be missing", path, share, "path [m]", "%"),
        chart("The same over time", time, share, "mission time [s]", "%"),
        chart("PSNR of the newest frame before it is learnt", time, series.psnr_current_db, "time [s]", "dB"),
        chart("Gaussians", time, series.n_gaussians, "mission time [s]", ""),
        chart("T_P, each planning cycle", series.plan_time_s, series.planning_s, "mission time [s]", "s"),
        chart("Mapping, each frame", time, series.mapping_s, "mission time [s]", "s, wall"),
    ]


def _completion_charts(report: MissionReport) -> list[str]:
    if not report.completion_curve:
        return []
    path, time, ratio = np.array([(p.path_m, p.time_s, 100 * p.ratio) for p in report.completion_curve]).T
    over_path, over_time = (Series(name="observable", x=x, y=ratio) for x in (path, time))
    return [
        line_chart("Completion ratio, observable", [over_path], x_label="path [m]", y_label="%"),
        line_chart("The same over time", [over_time], x_label="mission time [s]", y_label="%"),
    ]


def _unseen(report: MissionReport) -> list[str]:
    body = [heading("What stayed unseen")]
    if not report.unseen:
        return [*body, paragraph("Nothing that the robot knew to be missing.")]
    volumes: dict[str, list[float]] = defaultdict(list)
    for entry in report.unseen:
        volumes[entry.reason].append(entry.volume_m3)
    rows = [
        (
            reason.replace("_", " "),
            f"{sum(volumes[reason]):.2f} m³",
            f"{_REASONS.get(reason, reason)} ({_regions(len(volumes[reason]))})",
        )
        for reason in sorted(volumes, key=lambda reason: -sum(volumes[reason]))
    ]
    return [*body, table(("reason", "volume", "what it means"), rows)]


def _regions(n: int) -> str:
    return "1 region" if n == 1 else f"{n} regions"


def _views(
    folder: Path,
    config: MissionConfig,
    report: MissionReport,
    gaussians: GaussianMap,
    caster: RayCaster | None,
) -> list[str]:
    body = [heading("Where the map is wrong, and whether it knows")]
    camera = config.sensor.camera
    has_held_out = caster is not None and any(image.psnr_db is not None for image in report.held_out_images)
    if not has_held_out and not (folder / TRANSFORMS).is_file():
        return [*body, paragraph("There are neither held-out views nor keyframes to compare the map with.")]
    poses = read_trajectory(folder / "trajectory.txt").poses
    predictors = ErrorPredictors.of(gaussians, camera.intrinsics(), poses, range_m=camera.range_m)
    if caster is not None and has_held_out:
        shown = held_out_views(report.held_out_images, caster, gaussians, predictors, camera.intrinsics())
        body += [
            paragraph(
                "Held-out views, from poses that no frame was taken from. Figures are over surface that some "
                "frame had seen; pictures show everything."
            ),
            _score_table(_scores(report)),
        ]
    else:
        views = keyframe_views(KeyframeArchive.open(folder), gaussians, predictors)
        shown = views.shown
        body += [
            paragraph(
                "This run has no held-out views, so these are keyframes, which the map was learnt from: it "
                "is better here than elsewhere. Figures are over pixels with a measured depth; pictures show "
                "everything."
            ),
            _score_table(_scores_of(views)),
        ]
    body.append(
        paragraph(
            "The quality-gain map shows the variance that is left in the map's colours by the Fisher "
            "information of all frames: bright where another look would teach most. Rank correlation: do its "
            "places stand in the order of their true errors (1: exactly; 0: as by chance)? Sparsification "
            "error: how much worse than by the true order is it to drop the worst places by it (0: perfect)?"
        )
    )
    for view in shown:
        body += _view(view)
    return body


def _score_table(rows: Sequence[tuple[str, str, str]]) -> str:
    head = ("predictor of the error", "rank correlation", "sparsification error")
    return table(head, rows, ("name", "value", "value"))


def _scores(report: MissionReport) -> list[tuple[str, str, str]]:
    return _score_rows(
        (report.quality_correlation, report.sparsification_error),
        (report.quality_correlation_gain, report.sparsification_error_gain),
        (report.quality_correlation_depth_only, report.sparsification_error_depth_only),
        report.sparsification_error_constant,
    )


def _scores_of(views: KeyframeViews) -> list[tuple[str, str, str]]:
    def mean(name: str, figure: str) -> float | None:
        values = np.array([getattr(getattr(score, name), figure) for score in views.scores])
        return float(np.nanmean(values)) if np.isfinite(values).any() else None

    quality, gain, depth = (
        (mean(name, "correlation"), mean(name, "sparsification_error"))
        for name in ("quality", "gain", "depth")
    )
    return _score_rows(quality, gain, depth, mean("constant", "sparsification_error"))


_Score = tuple[float | None, float | None]


def _score_rows(
    quality: _Score, gain: _Score, depth: _Score, constant: float | None
) -> list[tuple[str, str, str]]:
    rows: Sequence[tuple[str, _Score]] = (
        ("quality gain: variance left in the colours", quality),
        ("quality gain of the single pixel (Eq. 9)", gain),
        ("depth alone", depth),
        ("a constant", (0.0, constant)),
    )
    return [(name, _number(score[0], 3), _number(score[1], 3)) for name, score in rows]


def _view(view: ShownView) -> list[str]:
    correlation = _number(view.quality_correlation, 3)
    by_depth = _number(view.depth_correlation, 3)
    title = (
        f"{view.rank.capitalize()} view: {view.psnr_db:.1f} dB; quality gain and error correlate by "
        f"{correlation} (depth alone: {by_depth})"
    )
    pictures = [
        picture(view.observed, "observed"),
        picture((view.rendered * 255.0 + 0.5).astype(np.uint8), "rendered"),
        picture(
            colourise(view.error / _LARGEST_ERROR), f"absolute colour error, brightest at {_LARGEST_ERROR:g}"
        ),
        picture(colourise_log(view.uncertainty, decades=2.0), "quality gain, logarithmic over two decades"),
        picture(colourise_depth(view.depth_m), "rendered depth, near is bright"),
    ]
    return [heading(title, 3), group("views", pictures)]


def _number(value: float | None, decimals: int, unit: str = "") -> str:
    return "-" if value is None or not np.isfinite(value) else f"{value:.{decimals}f} {unit}".rstrip()
