"""A mission's report as the table that closes `hgs run` and `hgs evaluate`."""

from __future__ import annotations

from collections import defaultdict

from rich.table import Table

from hgs_core.evaluation.report import MissionReport


def report_table(report: MissionReport) -> Table:
    """The figures that a reader looks for first; everything else is in `report.json`."""
    table = Table(title=f"{report.scene}, seed {report.seed}, {report.planner}", title_justify="left")
    table.add_column("figure")
    table.add_column("value", justify="right")
    table.add_column("")
    ended = f"{report.stop_reason}: {report.stop_message}" if report.stop_message else report.stop_reason
    wall = _number(report.wall_s, 0, "s")
    rows: list[tuple[str, str, str]] = [
        ("ended", report.stop_reason, ended.removeprefix(f"{report.stop_reason}: ")),
        ("time", _number(report.sim_time_s, 1, "s"), f"{report.clock} clock; {wall} wall"),
        ("path", _number(report.path_length_m, 1, "m"), f"{report.collisions} collisions"),
        ("frames", str(report.frames), _frames(report)),
        ("Gaussians", f"{report.n_gaussians:,}", ""),
        ("accuracy", _number(report.accuracy_cm, 2, "cm"), "all centres to the true surface"),
        ("completion", _number(report.completion_cm, 2, "cm"), "whole surface"),
        ("", _number(report.completion_cm_observable, 2, "cm"), "observable surface"),
        ("completion ratio", _number(report.completion_ratio, 3), "whole surface, 5 cm"),
        (
            "",
            _number(report.completion_ratio_observable, 3),
            f"observable surface ({_percent(report.observable_fraction)} of it)",
        ),
        ("F1", _number(report.f1_5cm, 3), "5 cm"),
        ("PSNR", _number(report.psnr_db, 2, "dB"), f"{_number(report.psnr_db_unmasked, 2, 'dB')} unmasked"),
        ("SSIM", _number(report.ssim, 3), f"over {_percent(report.observed_mask_share)} of held-out pixels"),
        ("depth L1", _number(report.depth_l1_cm, 2, "cm"), ""),
        ("planning", _number(report.planning_s.median, 3, "s"), "median of a cycle"),
        ("mapping", _number(report.mapping_s_per_frame, 3, "s"), "mean of a frame"),
        ("real-time factor", _number(report.real_time_factor, 2), ""),
        ("peak memory", _number(report.peak_rss_mib, 0, "MiB"), ""),
    ]
    for row in rows:
        table.add_row(*row)
    volumes: dict[str, float] = defaultdict(float)
    for entry in report.unseen:
        volumes[entry.reason] += entry.volume_m3
    for reason, volume in sorted(volumes.items()):
        table.add_row("left unseen", _number(volume, 2, "m³"), reason.replace("_", " "))
    return table


def _frames(report: MissionReport) -> str:
    keyframes = f"{report.keyframes} keyframes"
    if report.clock == "lockstep":
        return keyframes
    return f"{keyframes}, {report.frames_thinned} thinned, {report.frames_dropped} dropped"


def _number(value: float | None, decimals: int, unit: str = "") -> str:
    return "-" if value is None else f"{value:.{decimals}f} {unit}".rstrip()


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.0%}"
