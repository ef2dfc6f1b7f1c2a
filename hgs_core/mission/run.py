"""`run_mission`: from a request to a finished folder, over crashes if need be."""

from __future__ import annotations

import resource
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, Final

from hgs_core.errors import CheckpointError, ConfigError, HgsError
from hgs_core.evaluation.report import MissionReport
from hgs_core.live.link import Link
from hgs_core.live.world import LiveWorld
from hgs_core.mission.build import MissionParts, build_mission
from hgs_core.mission.checkpoint import Checkpoint, CheckpointFolder
from hgs_core.mission.checkpoint_keeper import CheckpointKeeper, CheckpointTold
from hgs_core.mission.commands import CommandSource, Order
from hgs_core.mission.config import MissionConfig, resolve_mission_config
from hgs_core.mission.disk_room import DiskRoom
from hgs_core.mission.events import (
    CheckpointWritten,
    MissionEnded,
    MissionObserver,
    MissionPhase,
    Notice,
    PhaseChanged,
    Resumed,
    StopReason,
)
from hgs_core.mission.finished_run import FinishedRun, write_run_config
from hgs_core.mission.folder import EventLog, RunFolder, partial_of
from hgs_core.mission.live import OrdersBefore, Suspended, meet_robot
from hgs_core.mission.old_map import OldMap
from hgs_core.mission.record import MissionRecord
from hgs_core.mission.report_page import write_report_page
from hgs_core.mission.request import MissionRequest as MissionRequest
from hgs_core.mission.results import Progress, evaluated, fused_mesh, report_of, write_results
from hgs_core.mission.versions import software_versions
from hgs_core.native import kernels
from hgs_core.scene.sources.live import LIVE


def run_mission(
    request: MissionRequest,
    *,
    observer: MissionObserver,
    commands: CommandSource,
    link: Link | None = None,
) -> MissionReport | None:
    """Run one mission and write its folder. Blocks until it has ended and been evaluated, or was suspended:
    then there is no report yet, and a request with `resume` goes on. A mission in the scene `live` meets its
    robot over `link`.

    An interrupted mission leaves a complete folder at once, without the mesh and the quality figures that
    take their time (`hgs mesh`, `hgs evaluate` and `hgs report` add them). Raises `ConfigError` or
    `SceneError` before anything is written, and `CheckpointError` where a mission cannot be gone on with,
    whose folder stays as it is; a later `HgsError` ends the mission with `failed`.
    """
    request, config = _resolved(request)
    if (request.scene == LIVE) != (link is not None):
        raise ConfigError(_WRONG_LINK)
    folder = RunFolder.take_up(request.out) if request.resume else RunFolder.new(request.out)
    if folder is None:
        return _told_again(request, observer)
    kernels.set_threads(config.threads)
    with folder:
        log = EventLog(folder.events, observer)
        try:
            return _Run(request, config, folder, log, link).to_its_end(commands)
        finally:
            log.close()


_WRONG_LINK: Final = (
    f"a mission in the scene {LIVE!r}, and no other, meets its robot over a link: start it with `hgs serve`, "
    "and let a robot connect"
)


class _Run:
    """One process's part in a mission: all of it, or from a checkpoint on."""

    def __init__(
        self,
        request: MissionRequest,
        config: MissionConfig,
        folder: RunFolder,
        log: EventLog,
        link: Link | None,
    ) -> None:
        self._request = request
        self._config = config
        self._folder = folder
        self._log = log
        self._link = link
        self._checkpoints = CheckpointFolder(folder.partial, folder.checkpoints)
        self._earlier_rss_mib = 0.0

    def to_its_end(self, commands: CommandSource) -> MissionReport | None:
        """See `run_mission`."""
        checkpoint = None if self._folder.is_new else self._take_up()
        with ExitStack() as held:
            live = None
            if self._link is not None:
                orders = commands = OrdersBefore(commands)
                live = self._meet(self._link, orders, checkpoint=checkpoint, held=held)
                if live is None:
                    return None
            parts = self._build(commands, checkpoint, live)
            keeper = self._keeper(parts, checkpoint)
            try:
                try:
                    record = _explored(parts, keeper)
                finally:
                    if live is not None:
                        live.robot.stop()  # whatever takes its time now, nobody looks where it drives
                if record.stop_reason is None:
                    self._suspend(parts, keeper)
                    return None
            finally:
                keeper.finish()
            if live is not None:
                live.end(record.message)
        report = self._write(parts, record)
        self._folder.complete()
        return report

    def _meet(
        self, link: Link, orders: OrdersBefore, *, checkpoint: Checkpoint | None, held: ExitStack
    ) -> LiveWorld | None:
        """The robot's world, once it has said hello; None where the mission was suspended before. What the
        robot carries and how it drives takes the place of the preset's. `held` lets the robot go."""
        log = self._log

        def say(reason: str) -> None:
            log.on_event(PhaseChanged(time_s=0.0, phase=MissionPhase.PREPARING, reason=reason))

        def notice(time_s: float, message: str) -> None:
            log.on_event(Notice(time_s=time_s, level="warning", message=message))

        try:
            self._config, world = meet_robot(
                link,
                self._config,
                earlier=None if checkpoint is None else checkpoint.state["parts"]["world"],
                orders=orders,
                say=say,
                notice=notice,
            )
        except Suspended:
            reason = "nothing could be saved: it would start again"
            log.on_event(PhaseChanged(time_s=0.0, phase=MissionPhase.SUSPENDED, reason=reason))
            return None
        except HgsError:
            self._leave_nothing()
            raise
        held.callback(world.leave)
        return world

    def _leave_nothing(self) -> None:
        """A mission that cannot begin leaves nothing behind."""
        if self._folder.is_new:
            self._folder.discard()

    def _take_up(self) -> Checkpoint | None:
        """What there is to go on from; without any, the mission starts again."""
        checkpoint, complaints = self._checkpoints.newest()
        if checkpoint is None:
            from_s, reason = 0.0, "nothing had been saved yet: the mission starts again"
            self._folder.clear()
        else:
            from_s = float(checkpoint.state["time_s"])
            reason = f"going on from the checkpoint of {from_s:.1f} s"
            self._checkpoints.go_on_from(checkpoint)
            self._folder.remove_keyframes_except(checkpoint.files)
        self._log.go_on_from(from_s)
        self._log.on_event(Resumed(time_s=from_s, reason=reason))
        for message in complaints:
            self._log.on_event(Notice(time_s=from_s, level="warning", message=message))
        return checkpoint

    def _build(
        self, commands: CommandSource, checkpoint: Checkpoint | None, live: LiveWorld | None
    ) -> MissionParts:
        request, config, log = self._request, self._config, self._log
        if live is None:
            reason = f"opening scene {request.scene}"
            log.on_event(PhaseChanged(time_s=0.0, phase=MissionPhase.PREPARING, reason=reason))
        room = DiskRoom(
            folder=self._folder.partial, least_free_bytes=config.checkpoint.least_free_mib * 2**20
        )
        try:
            old_map = None
            if request.extends is not None and checkpoint is None:
                old_map = OldMap.open(request.extends, request.scene, config)
            parts = build_mission(
                config,
                request.scene,
                request.seed,
                self._folder.keyframes,
                observer=log,
                commands=commands,
                why_wait=room.why_wait,
                old_map=old_map,
                live=live,
            )
        except HgsError:
            self._leave_nothing()
            raise
        if checkpoint is not None:
            self._restore(parts, checkpoint)
            return parts
        if parts.scene is not None:
            for message in parts.scene.notices:
                log.on_event(Notice(time_s=0.0, level="warning", message=message))
        write_run_config(self._folder.partial, request, config, parts.start)
        return parts

    def _restore(self, parts: MissionParts, checkpoint: Checkpoint) -> None:
        state = checkpoint.state
        try:
            self._earlier_rss_mib = float(state["peak_rss_mib"])
            parts.restore(state["parts"], keyframe_folder=self._folder.keyframes)
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise CheckpointError(
                f"{checkpoint.path} does not fit this mission and this version: {error!r}"
            ) from error
        for what, now in _software().items():
            if state["software"].get(what) != now:
                message = (
                    f"goes on with {what} {now}, after {state['software'].get(what)}: the last digits may "
                    "differ from those of a mission that was not interrupted"
                )
                self._log.on_event(Notice(time_s=parts.mission.time_s, level="warning", message=message))

    def _keeper(self, parts: MissionParts, checkpoint: Checkpoint | None) -> CheckpointKeeper:
        mission = parts.mission

        def state() -> dict[str, Any]:
            return {
                "time_s": mission.time_s,
                "software": _software(),
                "peak_rss_mib": self._peak_rss_mib(),
                "parts": parts.state(),
            }

        def tell(told: CheckpointTold) -> None:
            if told.problem is None:
                self._log.on_event(
                    CheckpointWritten(
                        time_s=mission.time_s,
                        saved_s=told.saved_s,
                        size_bytes=told.size_bytes,
                        took_s=told.took_s,
                    )
                )
            else:
                self._log.on_event(Notice(time_s=mission.time_s, level="warning", message=told.problem))

        return CheckpointKeeper(
            self._checkpoints,
            self._config.checkpoint,
            state=state,
            files=lambda: parts.mapper.keyframes.files(),
            mission=mission,
            kept_s=None if checkpoint is None else float(checkpoint.state["time_s"]),
            tell=tell,
        )

    def _suspend(self, parts: MissionParts, keeper: CheckpointKeeper) -> None:
        keeper.save()
        kept_s = keeper.finish()
        reason = (
            "nothing could be saved: it would start again"
            if kept_s is None
            else f"saved as it was at {kept_s:.1f} s, to be gone on with"
        )
        self._log.on_event(
            PhaseChanged(time_s=parts.mission.time_s, phase=MissionPhase.SUSPENDED, reason=reason)
        )

    def _write(self, parts: MissionParts, record: MissionRecord) -> MissionReport:
        """All results, into the unfinished folder."""
        config, folder, scene = self._config, self._folder.partial, parts.scene
        report = report_of(self._request, config, parts, record, peak_rss_mib=self._peak_rss_mib())
        progress = Progress(self._log, parts.mission.time_s)
        write_results(folder, config, parts, record)
        if record.stop_reason is not StopReason.INTERRUPTED and record.poses:
            mesh = fused_mesh(folder, config, progress)
            if config.evaluate and scene is not None:
                report = report.with_evaluation(evaluated(config, parts, scene, record, mesh, progress))
        report.write(folder / "report.json")
        caster = scene.caster if config.evaluate and scene is not None else None
        write_report_page(folder, config, caster=caster, progress=progress)
        self._log.on_event(
            PhaseChanged(time_s=progress.time_s, phase=MissionPhase.ENDED, reason=record.message)
        )
        return report

    def _peak_rss_mib(self) -> float:
        return max(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0, self._earlier_rss_mib)


def _resolved(request: MissionRequest) -> tuple[MissionRequest, MissionConfig]:
    """What is to be run; of a run that is taken up, as it was begun, whatever its preset says now."""
    if request.resume and FinishedRun.is_described(partial_of(request.out)):
        begun = FinishedRun.open(partial_of(request.out))
        return replace(request, **begun.asked_for()), begun.config
    overrides = dict(request.overrides)
    if request.planner is not None:
        overrides["planner"] = request.planner
    if request.max_time_s is not None:
        overrides["limits.max_time_s"] = repr(request.max_time_s)
    if request.clock is not None:
        overrides["clock"] = request.clock
    return request, resolve_mission_config(request.preset, overrides)


def _told_again(request: MissionRequest, observer: MissionObserver) -> MissionReport:
    """A run that had come to its end before anybody was told."""
    report = MissionReport.read(request.out / "report.json")
    observer.on_event(
        MissionEnded(
            time_s=report.sim_time_s or 0.0,
            stop_reason=StopReason(report.stop_reason),
            message=report.stop_message,
        )
    )
    return report


def _explored(parts: MissionParts, keeper: CheckpointKeeper) -> MissionRecord:
    try:
        return parts.mission.run(between_frames=keeper.between_frames)
    except HgsError as error:
        record = parts.mission.record
        record.stop_reason = StopReason.FAILED
        record.message = f"{type(error).__name__}: {error}"
        return record


def _software() -> dict[str, str]:
    """What decides the last digits, beside the settings."""
    return {**software_versions(), "kernels": kernels.variant()}


class NoCommands:
    """A `CommandSource` without an operator."""

    def poll(self) -> Order | None:
        return None
