"""What the page's form is generated from, and how refused settings are told."""

import jsonschema
import pytest

from app.catalogue import time_limit_s
from hgs_core.config.presets import preset_names
from hgs_core.mission.config import resolve_mission_config
from hgs_core.mission.settings_schema import planner_names, settings_schema


@pytest.mark.parametrize("preset", preset_names("mission"))
def test_the_schema_describes_what_the_preset_holds(preset):
    config = resolve_mission_config(preset, {})
    schema = settings_schema(config)
    jsonschema.validate(config.model_dump(mode="json"), schema)
    wrong = config.model_dump(mode="json")
    wrong["planner"]["nothing"] = 1
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(wrong, schema)


def test_settings_come_with_meaning_range_and_value(service):
    client = service()
    told = client.get("/api/v1/presets/quick/settings").json()
    limits = told["settings_schema"]["$defs"]["MissionLimits"]["properties"]["max_time_s"]
    assert "[s]" in limits["description"]
    assert limits["exclusiveMinimum"] == 0
    assert told["values"]["limits"]["max_time_s"] == limits["default"] == 3600
    assert told["planners"] == planner_names()
    assert client.get("/api/v1/presets/none/settings").status_code == 404


def test_another_planner_has_settings_of_its_own(service):
    client = service()
    path = "/api/v1/presets/quick/settings"
    own = client.get(path).json()["values"]["planner"]
    other = client.get(path, params={"planner": "random"}).json()["values"]["planner"]
    assert own["method"] != other["method"]
    refused = client.get(path, params={"planner": "clever"})
    assert refused.status_code == 422
    assert "random" in refused.json()["errors"][0]["allowed"]


def test_a_saved_preset_has_its_own_values(service):
    client = service()
    saved = {"base": "quick", "overrides": {"limits.max_time_s": "30"}}
    assert client.put("/api/v1/presets/mine", json=saved).status_code == 201
    assert client.get("/api/v1/presets/mine/settings").json()["values"]["limits"]["max_time_s"] == 30
    mission = client.post("/api/v1/missions", json={"preset": "mine"}).json()
    assert mission["time_limit_s"] == 30
    mission = client.post("/api/v1/missions", json={"preset": "mine", "max_time_s": 12}).json()
    assert mission["time_limit_s"] == 12


def test_a_mission_of_settings_that_are_no_more_can_still_be_looked_at():
    """A record of an earlier version: nothing is said of its limit, and nothing fails."""
    assert time_limit_s("quick", {"limits.max_time_s": "30"}) == 30
    assert time_limit_s("quick", {"mapping.setting_of_old": "1"}) is None
    assert time_limit_s("a preset of old", {}) is None


def test_every_refused_setting_is_named_by_its_path(service):
    client = service()
    wish = {"preset": "quick", "overrides": {"limits.max_time_s": "-3", "mapping.loss.colour": "much"}}
    answer = client.post("/api/v1/missions", json=wish)
    assert answer.status_code == 422
    errors = {entry["field"]: entry for entry in answer.json()["errors"]}
    assert set(errors) == {"overrides.limits.max_time_s", "overrides.mapping.loss.colour"}
    assert errors["overrides.limits.max_time_s"]["value"] == "-3"
    assert "greater than 0" in errors["overrides.limits.max_time_s"]["message"]
