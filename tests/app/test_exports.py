"""Everything of a mission in one file."""

import io
import zipfile

from app.archive import zipped
from tests.app.conftest import begin, create, wait_for


def test_all_results_come_as_one_zip(service):
    client = service("run_short")
    mission = begin(client)
    wait_for(client, mission, "completed")
    folder = client.app.state.service.get(mission).results_dir
    (folder / "keyframes").mkdir()
    (folder / "keyframes" / "000000.jpg").write_bytes(b"picture")
    path = f"/api/v1/missions/{mission}/results.zip"
    answer = client.get(path)
    assert answer.headers["content-type"] == "application/zip"
    assert mission in answer.headers["content-disposition"]
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        names = set(archive.namelist())
        assert {f"{mission}/report.json", f"{mission}/process.log"} <= names
        assert archive.read(f"{mission}/report.json") == (folder / "report.json").read_bytes()
        assert archive.read(f"{mission}/keyframes/000000.jpg") == b"picture"
    with zipfile.ZipFile(io.BytesIO(client.get(path, params={"keyframes": False}).content)) as archive:
        assert set(archive.namelist()) == names - {f"{mission}/keyframes/000000.jpg"}


def test_a_mission_without_results_says_so(service):
    client = service()
    answer = client.get(f"/api/v1/missions/{create(client)}/results.zip")
    assert answer.status_code == 404
    assert "no results" in answer.json()["detail"]


def test_a_large_file_passes_in_pieces(tmp_path):
    """However large the files are, a piece holds no more than is read at once, and a few heads."""
    content = bytes(range(256)) * 16_384  # 4 MiB
    (tmp_path / "map.ply").write_bytes(content)
    (tmp_path / "report.json").write_bytes(b"{}")
    files = {
        "m/map.ply": tmp_path / "map.ply",
        "m/gone": tmp_path / "gone",
        "m/report.json": tmp_path / "report.json",
    }
    pieces = list(zipped(files))
    assert max(map(len, pieces)) < 300 * 1024
    with zipfile.ZipFile(io.BytesIO(b"".join(pieces))) as archive:
        assert archive.namelist() == ["m/map.ply", "m/report.json"]
        assert archive.read("m/map.ply") == content
