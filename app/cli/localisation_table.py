"""The figures of `hgs bench localisation` as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from app.cli.console import OUTPUT

if TYPE_CHECKING:
    from hgs_core.benchmark.localisation import LocalisationBenchmark
    from hgs_core.benchmark.localised_maps import LocalisedMaps
    from hgs_core.evaluation.trajectory_error import ErrorSpread


def print_localisation(figures: LocalisationBenchmark) -> None:
    aligned = figures.first_pose
    lost = (
        f"{figures.lost} lost"
        if figures.first_reason is None
        else (f"{figures.lost} lost, the first because {figures.first_reason}")
    )
    OUTPUT.print(
        f"{figures.source}, {figures.method}: {figures.frames} frames, {lost}; errors "
        f"over the {aligned.length_m:.1f} m between those that were located; "
        f"{1000 * figures.processor_s_per_frame:.0f} ms of processor time a frame",
        highlight=False,
        markup=False,
        soft_wrap=True,
    )
    table = Table("", "rmse", "mean", "median", "largest")
    rows = (
        ("ATE cm, nearest alignment (Umeyama)", figures.umeyama.ate_m, 100.0),
        ("ATE cm, first poses aligned", aligned.ate_m, 100.0),
        (f"RPE cm, {aligned.rpe_delta} frame on", aligned.rpe_m, 100.0),
        (f"RPE degrees, {aligned.rpe_delta} frame on", aligned.rpe_deg, 1.0),
    )
    for name, spread, factor in rows:
        table.add_row(name, *_cells(spread, factor))
    OUTPUT.print(table)
    OUTPUT.print(f"drift at the end: {aligned.drift_percent:.2f} % of the path", highlight=False)
    if figures.maps is not None:
        _print_maps(figures.maps)


def _print_maps(maps: LocalisedMaps) -> None:
    table = Table(title="what it costs the map", title_justify="left")
    for name in ("", "true poses", "nearest alignment", "first poses aligned"):
        table.add_column(name, justify="right" if name else "left")
    columns = (maps.true_poses, maps.nearest, maps.first_pose)
    for name, key, form in (
        ("accuracy cm", "accuracy_cm", ".2f"),
        ("completion cm", "completion_cm_observable", ".2f"),
        ("completion ratio", "completion_ratio_observable", ".3f"),
        ("median depth error cm", "median_depth_error_cm", ".2f"),
        ("PSNR dB", "psnr_db", ".2f"),
        ("SSIM", "ssim", ".3f"),
        ("Gaussians", "n_gaussians", ","),
    ):
        table.add_row(name, *(f"{getattr(column, key):{form}}" for column in columns))
    OUTPUT.print(table)


def _cells(spread: ErrorSpread, factor: float) -> list[str]:
    values = (spread.rmse, spread.mean, spread.median, spread.max)
    return [f"{factor * value:.2f}" for value in values]
