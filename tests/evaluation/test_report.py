"""`report.json`: its keys are a promise."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from hgs_core.errors import ConfigError
from hgs_core.evaluation.compatibility import CompatibilityMetrics
from hgs_core.evaluation.report import MissionReport
from hgs_core.evaluation.report_parts import CurvePoint, PlanningCycle, Region, UnseenEntry
from hgs_core.evaluation.result import ErrorPrediction, EvaluationResult, ImageMetrics, ViewResult
from hgs_core.evaluation.surface import SurfaceMetrics
from hgs_core.evaluation.uncertainty import PredictionScore
from hgs_core.geometry.camera import level_camera_pose

PROMISED_KEYS = [
    "scene",
    "seed",
    "planner",
    "stop_reason",
    "wall_s",
    "sim_time_s",
    "path_length_m",
    "frames",
    "keyframes",
    "n_gaussians",
    "peak_rss_mib",
    "accuracy_cm",
    "completion_cm",
    "completion_ratio",
    "completion_cm_observable",
    "completion_ratio_observable",
    "observable_fraction",
    "precision_5cm",
    "f1_5cm",
    "psnr_db",
    "ssim",
    "depth_l1_cm",
    "psnr_db_unmasked",
    "observed_mask_share",
    "median_depth_error_cm",
    "schema_version",
    "versions",
    "kernel_variant",
    "threads",
    "planning_s",
    "mapping_s_per_frame",
    "real_time_factor",
    "collisions",
    "unseen",
    "clock",
    "frames_dropped",
    "frames_thinned",
    "iterations",
]

SURFACE = SurfaceMetrics(
    n_points=1000,
    accuracy_cm=1.25,
    accuracy_cm_to_samples=2.0,
    completion_cm=3.5,
    completion_ratio=0.625,
    completion_cm_observable=1.5,
    completion_ratio_observable=0.9375,
    precision=(0.25, 0.5, 0.75, 1.0),
    precision_to_samples=(0.1, 0.3, 0.7, 0.9),
    recall=(0.125, 0.375, 0.625, 0.875),
    f1=(0.2, 0.4, 0.6, 0.8),
)


def view(correlation: float) -> ViewResult:
    """A view whose four predictors score `correlation` and 0.25, 0.5, 0.75 below it."""
    scores = [
        PredictionScore(correlation=correlation - below, sparsification_error=0.1 + below)
        for below in (0.0, 0.25, 0.5, 0.75)
    ]
    return ViewResult(
        T_world_camera=level_camera_pose(1.0, 2.0, 1.0, 0.5),
        observed_share=0.75,
        psnr_db=24.0,
        ssim=0.5,
        prediction=ErrorPrediction(quality=scores[0], gain=scores[1], depth=scores[2], constant=scores[3]),
    )


EVALUATION = EvaluationResult(
    surface=SURFACE,
    surface_opaque=replace(SURFACE, n_points=800, accuracy_cm=1.0),
    naruto=CompatibilityMetrics(accuracy_cm=3.5, completion_cm=2.0, completion_ratio=0.7),
    activegamer=CompatibilityMetrics(accuracy_cm=1.1, completion_cm=3.6, completion_ratio=0.6),
    observable_fraction=0.6,
    n_reachable=500,
    images=ImageMetrics(
        n_views=40,
        psnr_db=25.0,
        ssim=0.8,
        depth_l1_cm=2.0,
        median_depth_error_cm=0.5,
        psnr_db_unmasked=22.0,
        ssim_unmasked=0.7,
        observed_mask_share=0.9,
        views=(view(0.5), view(0.75), view(float("nan"))),
    ),
    wall_s=60.0,
)


def compose(evaluation: EvaluationResult | None = EVALUATION) -> MissionReport:
    return MissionReport.compose(
        scene="house",
        seed=3,
        preset="paper",
        planner="paper",
        stop_reason="complete",
        stop_message="nothing left",
        wall_s=100.0,
        sim_time_s=60.0,
        path_length_m=40.0,
        frames=150,
        keyframes=20,
        n_gaussians=1000,
        peak_rss_mib=900.0,
        planning_cycles=[
            PlanningCycle(viewpoint_evaluation_s=0.1, local_s=0.2, global_s=0.3),
            PlanningCycle(viewpoint_evaluation_s=0.3, local_s=0.2, global_s=0.5),
        ],
        mapping_s=[0.1, 0.3],
        clock="real",
        iterations=1500,
        frames_dropped=4,
        frames_thinned=6,
        simulation_wall_s=20.0,
        collisions=0,
        unseen=[
            UnseenEntry(
                region=Region(lower_m=(0, 0, 0), upper_m=(1, 1, 1)), volume_m3=0.5, reason="unreachable"
            )
        ],
        versions={"hgs": "0.1.0"},
        kernel_variant="generic",
        threads=2,
        evaluation=evaluation,
    )


def test_every_promised_key_is_written(tmp_path: Path) -> None:
    compose().write(tmp_path / "report.json")
    written = json.loads((tmp_path / "report.json").read_text())
    assert set(PROMISED_KEYS) <= set(written)
    assert set(written["planning_s"]) == {"median", "p95", "viewpoint_evaluation", "local", "global"}
    assert set(written["unseen"][0]) == {"region", "volume_m3", "reason"}
    assert [path.name for path in tmp_path.iterdir()] == ["report.json"]


def test_figures_come_from_their_sources() -> None:
    report = compose()
    assert report.planning_s.median == pytest.approx(0.8)
    assert report.planning_s.global_ == pytest.approx(0.4)
    assert report.mapping_s_per_frame == pytest.approx(0.2)
    assert report.real_time_factor == pytest.approx(60 / (0.4 + 1.6))
    assert (report.precision_5cm, report.recall_10cm, report.f1_1cm) == (0.75, 0.875, 0.2)
    assert (report.accuracy_cm, report.accuracy_cm_opaque, report.n_gaussians_opaque) == (1.25, 1.0, 800)
    assert (report.psnr_db, report.observable_fraction) == (25.0, 0.6)


def test_predictors_are_averaged_over_the_views_that_have_a_score() -> None:
    report = compose()
    assert report.quality_correlation == pytest.approx(0.625)
    assert report.quality_correlation_gain == pytest.approx(0.375)
    assert report.quality_correlation_depth_only == pytest.approx(0.125)
    assert report.sparsification_error == pytest.approx(0.1)
    assert report.sparsification_error_constant == pytest.approx(0.85)
    first, _, last = report.held_out_images
    assert first.position_m == (1.0, 2.0, 1.0)
    assert (first.psnr_db, first.observed_share, first.quality_correlation) == (24.0, 0.75, 0.5)
    assert last.quality_correlation is None


def test_a_mesh_has_columns_of_its_own_that_go_with_it() -> None:
    assert compose().accuracy_cm_mesh is None
    meshed = replace(EVALUATION, surface_mesh=replace(SURFACE, n_points=70, accuracy_cm=0.5))
    report = compose(meshed)
    assert (report.n_vertices_mesh, report.accuracy_cm_mesh, report.f1_5cm_mesh) == (70, 0.5, 0.6)
    assert report.accuracy_cm == 1.25
    assert report.with_evaluation(EVALUATION) == compose()


def test_other_evaluators_figures_stand_under_names_of_their_own() -> None:
    report = compose()
    assert (report.compat_naruto_accuracy_cm, report.compat_naruto_completion_ratio) == (3.5, 0.7)
    assert (report.compat_activegamer_completion_cm, report.compat_activegamer_accuracy_cm) == (3.6, 1.1)


CURVE = (
    CurvePoint(path_m=0.0, time_s=1.0, ratio=0.5),
    CurvePoint(path_m=20.0, time_s=31.0, ratio=1.0),
    CurvePoint(path_m=40.0, time_s=60.0, ratio=1.0),
)


def test_a_curve_ends_with_the_evaluation_of_the_missions_map() -> None:
    """0.90 lies four fifths of the way from 0.5 to 1.0; SURFACE is complete to 0.9375."""
    report = compose(None).model_copy(update={"completion_curve": CURVE}).with_evaluation(EVALUATION)
    assert [point.ratio for point in report.completion_curve] == [0.5, 1.0, 0.9375]
    assert (report.path_m_at_90, report.path_m_at_95) == (pytest.approx(16.0), pytest.approx(18.0))
    assert report.time_s_at_90 == pytest.approx(25.0)
    assert report.with_evaluation(EVALUATION) == report


def test_a_refined_map_is_none_of_the_missions_curve() -> None:
    report = compose(None).model_copy(update={"completion_curve": CURVE}).with_evaluation(EVALUATION)
    refined = report.refined(seconds=1.0, steps=10)
    assert refined.compat_naruto_completion_ratio is None
    assert refined.completion_curve == report.completion_curve
    better = replace(EVALUATION, surface=replace(SURFACE, completion_ratio_observable=0.99))
    again = refined.with_evaluation(better)
    assert again.completion_ratio_observable == 0.99
    assert again.completion_curve == report.completion_curve


def test_round_trip(tmp_path: Path) -> None:
    report = compose()
    report.write(tmp_path / "report.json")
    assert MissionReport.read(tmp_path / "report.json") == report


def test_without_an_evaluation_quality_is_null(tmp_path: Path) -> None:
    report = compose(None)
    report.write(tmp_path / "report.json")
    written = json.loads((tmp_path / "report.json").read_text())
    assert written["psnr_db"] is None
    assert written["accuracy_cm"] is None
    assert MissionReport.read(tmp_path / "report.json") == report
    assert report.with_evaluation(EVALUATION) == compose()


def test_what_is_not_finite_becomes_null(tmp_path: Path) -> None:
    """An empty map has no accuracy, a perfect image infinite PSNR: JSON knows neither."""
    images = replace(EVALUATION.images, psnr_db=float("inf"), ssim=float("nan"))
    compose(replace(EVALUATION, images=images)).write(tmp_path / "report.json")
    text = (tmp_path / "report.json").read_text()
    assert "NaN" not in text
    assert "Infinity" not in text
    assert json.loads(text)["psnr_db"] is None


def test_a_mission_without_cycles_or_frames() -> None:
    report = compose(None)
    empty = MissionReport.compose(
        **{
            name: getattr(report, name)
            for name in (
                *(
                    "scene",
                    "seed",
                    "preset",
                    "planner",
                    "stop_reason",
                    "stop_message",
                    "wall_s",
                    "sim_time_s",
                ),
                *("path_length_m", "peak_rss_mib", "simulation_wall_s", "collisions", "versions"),
                *("kernel_variant", "threads", "clock", "iterations", "frames_dropped", "frames_thinned"),
            )
        },
        frames=0,
        keyframes=0,
        n_gaussians=0,
        planning_cycles=[],
        mapping_s=[],
        unseen=[],
        evaluation=None,
    )
    assert empty.planning_s.median is None
    assert empty.mapping_s_per_frame is None
    assert empty.real_time_factor is None


def test_an_interrupted_write_leaves_the_old_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "report.json"
    compose().write(path)
    before = path.read_bytes()

    def full_disk(self: Path, *_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full_disk)
    with pytest.raises(OSError, match="No space"):
        compose(None).write(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("{", "not JSON"),
        ("[]", "schema_version None"),
        ('{"schema_version": 99}', "schema_version 99"),
        ('{"schema_version": 1}', "not a mission report"),
    ],
)
def test_unreadable_reports_say_why(tmp_path: Path, content: str, reason: str) -> None:
    (tmp_path / "report.json").write_text(content)
    with pytest.raises(ConfigError, match=reason):
        MissionReport.read(tmp_path / "report.json")
