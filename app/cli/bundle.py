"""`hgs bundle`: everything that a report of a fault needs, in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import ERRORS, OUTPUT


def bundle(
    mission: Annotated[
        str, typer.Argument(metavar="ID|DIR", help="A mission of the service, or the folder of a run.")
    ],
    data_dir: Annotated[
        Path, typer.Option(envvar="HGS_DATA_DIR", help="Where the service keeps its missions.")
    ] = Path("runs"),
    out: Annotated[Path | None, typer.Option(help="The ZIP to write; NAME-bundle.zip otherwise.")] = None,
) -> None:
    """Write settings, versions, logs, events, report, last view and facts of the machine into one ZIP,
    without the map and the keyframes, and without secrets. The service may run meanwhile.

    Exit codes: 0 done, 2 there is no such mission or folder.
    """
    from app.archive import zipped
    from app.storage.data_dir import write_whole
    from hgs_core.errors import ConfigError

    folder = Path(mission)
    if folder.is_dir():
        name, content = folder.resolve().name, _of_run(folder)
    elif (data_dir / "missions" / mission).is_dir() and "/" not in mission:
        name, content = mission, _of_mission(mission, data_dir)
    else:
        raise ConfigError(f"{mission!r} is neither a folder nor a mission in {data_dir / 'missions'}")
    target = out if out is not None else Path(f"{name}-bundle.zip")
    parts = zipped({f"{name}/{key}": part for key, part in content.items()}, compressed=True)
    write_whole(target, lambda file: file.writelines(parts))
    OUTPUT.print(str(target), highlight=False, soft_wrap=True)


def _of_run(folder: Path) -> dict[str, Path | bytes]:
    from app.bundle import bundle_of
    from hgs_core.errors import ConfigError

    content = bundle_of(folder)
    if len(content) == 1:
        raise ConfigError(f"{folder} holds nothing that `hgs run` or the service left behind")
    return content


def _of_mission(mission: str, data_dir: Path) -> dict[str, Path | bytes]:
    from app.bundle import bundle_of
    from app.settings import settings_from_environment
    from app.storage.database import Database, StorageError
    from app.storage.missions import MissionStore
    from hgs_core.errors import ConfigError

    folder = data_dir / "missions" / mission
    try:
        settings = settings_from_environment(host="127.0.0.1", port=0, data_dir=data_dir, demo=False)
        if settings.database_url is None and not (data_dir / "hgs.db").is_file():
            raise ConfigError(f"there is no database in {data_dir}")
        database = Database(settings.database)
        try:
            store = MissionStore(database)
            record = store.find(mission)
            events = store.events(mission, limit=20_000, newest=True)
        finally:
            database.close()
    except (ConfigError, StorageError) as error:
        ERRORS.print(f"without the database's part: {error}", style="yellow", markup=False)
        return bundle_of(folder, remarks=[f"the database could not be read: {error}"])
    return bundle_of(
        folder, record=record, events=events, remarks=["the service's own log goes where it was started"]
    )
