import io

import numpy as np
from PIL import Image

from tests.app.conftest import begin, create, wait_for, wait_until
from tests.scene.scans import hm3d
from tests.scene.worlds import room


def test_images_come_with_a_tag_and_are_sent_once(service):
    client = service("run_long", display={"interval_s": 0.2})
    mission = begin(client)
    path = f"/api/v1/missions/{mission}/images"
    wait_until(lambda: client.get(f"{path}/observed").status_code == 200)
    sizes = {"observed": (160, 90), "rendered": (160, 90), "depth": (160, 90), "quality": (300, 169)}
    for kind, size in sizes.items():
        answer = client.get(f"{path}/{kind}")
        image = Image.open(io.BytesIO(answer.content))
        assert image.size == size, kind
        assert image.format == ("JPEG" if kind in ("observed", "rendered") else "PNG")
        assert np.asarray(image).std() > 0, kind
    client.post(f"/api/v1/missions/{mission}/stop")
    wait_for(client, mission, "aborted")
    tag = client.get(f"{path}/depth").headers["etag"]
    same = client.get(f"{path}/depth", headers={"If-None-Match": tag})
    assert same.status_code == 304
    assert same.content == b""
    assert client.get(f"{path}/depth", headers={"If-None-Match": '"old"'}).status_code == 200
    assert client.get(f"{path}/sketch").status_code == 422


def test_a_mission_without_images_says_so(service):
    client = service()
    mission = create(client)
    answer = client.get(f"/api/v1/missions/{mission}/images/observed")
    assert answer.status_code == 404
    assert "no images" in answer.json()["detail"]


def test_keyframe_images_can_be_fetched_but_do_not_crowd_the_list(service):
    client = service("run_short")
    mission = begin(client)
    wait_for(client, mission, "completed")
    folder = client.app.state.service.get(mission).results_dir
    (folder / "keyframes").mkdir()
    (folder / "keyframes" / "000000.jpg").write_bytes(b"picture")
    (folder / "transforms.json").write_text("{}")
    path = f"/api/v1/missions/{mission}/results"
    described = {entry["name"]: entry["description"] for entry in client.get(path).json()}
    assert "nerfstudio" in described["transforms.json"]
    assert not any(name.startswith("keyframes") for name in described)
    assert client.get(f"{path}/keyframes/000000.jpg").content == b"picture"
    assert client.get(f"{path}/keyframes/000001.jpg").status_code == 404


def test_no_result_name_leads_out_of_the_folder(service):
    client = service("run_short")
    mission = begin(client)
    wait_for(client, mission, "completed")
    folder = client.app.state.service.get(mission).results_dir
    (folder / "link.json").symlink_to(folder.parent / "last_view.npz")
    (folder / "outside").symlink_to(folder.parent)
    for name in (
        "../last_view.npz",
        "..%2flast_view.npz",
        "%2e%2e/last_view.npz",
        "..%5clast_view.npz",
        "/etc/passwd",
        "%2fetc%2fpasswd",
        "report.json/../../last_view.npz",
        "link.json",
        "outside/last_view.npz",
        "report.json%00.txt",
        "%00",
    ):
        answer = client.get(f"/api/v1/missions/{mission}/results/{name}")
        assert answer.status_code == 404, name
        assert answer.headers["content-type"] == "application/problem+json"


def test_scenes_are_the_built_in_ones_and_the_meshes_of_the_folder(service, tmp_path):
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    (scenes / "flat.glb").write_bytes(b"glTF")
    (scenes / "flat.json").write_text('{"description": "A flat"}')
    (scenes / "notes.txt").write_text("no mesh")
    (scenes / "empty.glb").mkdir()
    scan = hm3d(tmp_path, room(), forms=("glb",))
    scan.rename(scenes / scan.name)
    client = service("run_short", scenes_dir=scenes)
    found = {scene["name"]: scene for scene in client.get("/api/v1/scenes").json()}
    assert list(found) == ["house", "building", "warren", "live", "00800-TEEsavR23oF", "flat.glb"]
    assert [scene["kind"] for scene in found.values()] == [
        "built-in",
        "built-in",
        "built-in",
        "named",
        "folder",
        "file",
    ]
    assert found["flat.glb"]["description"].startswith("A flat")
    mission = create(client, scene="flat.glb")
    record = client.app.state.service.get(mission).record
    assert record.scene_source == str(scenes / "flat.glb")
    mission = create(client, scene=scan.name)
    assert client.app.state.service.get(mission).record.scene_source == str(scenes / scan.name)


def test_presets_are_described(service):
    presets = {preset["name"]: preset for preset in service().get("/api/v1/presets").json()}
    assert {"paper", "quick", "coverage", "quality"} <= set(presets)
    assert all(preset["description"] for preset in presets.values())


def test_the_page_is_served_with_a_strict_policy(service):
    client = service()
    page = client.get("/")
    assert page.status_code == 200
    assert "<mission-form>" in page.text
    policy = page.headers["content-security-policy"]
    assert "script-src 'self'" in policy
    assert "unsafe" not in policy
    for asset in ("/js/main.js", "/css/theme.css", "/icon.svg"):
        assert client.get(asset).status_code == 200
    assert "http" not in page.text.replace("http-equiv", "")  # nothing comes from elsewhere


def test_the_schema_can_be_read(service):
    schema = service().get("/openapi.json").json()
    operations = [op for path in schema["paths"].values() for op in path.values()]
    names = [op["operationId"] for op in operations]
    assert len(names) == len(set(names))
    assert "createMission" in names


def test_the_last_images_of_a_mission_stay_when_the_service_starts_again(service):
    client = service("run_short", display={"interval_s": 0.05})
    mission = begin(client)
    wait_for(client, mission, "completed")
    path = f"/api/v1/missions/{mission}/images"
    before = {kind: client.get(f"{path}/{kind}") for kind in ("observed", "rendered", "depth", "quality")}
    again = service("run_short")
    assert again.get(f"/api/v1/missions/{mission}").json()["view_sequence"] > 0
    for kind, answer in before.items():
        assert answer.status_code == 200
        found = again.get(f"{path}/{kind}")
        assert found.content == answer.content
        assert found.headers["etag"] == answer.headers["etag"]
