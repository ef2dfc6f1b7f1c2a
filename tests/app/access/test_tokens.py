"""Where the service may listen, and what a token is."""

import pytest
from typer.testing import CliRunner

from app.cli.application import application
from app.security.principal import Role
from app.security.tokens import new_token, tokens_of
from app.settings import AccessSettings, Settings, settings_from_environment
from hgs_core.errors import ConfigError
from tests.app.access.clients import API, OPERATOR, TOKENS, VIEWER, bearer


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "example.org", ""])
def test_addresses_that_others_reach_need_a_token(host, tmp_path):
    bare = Settings(data_dir=tmp_path, host=host)
    with pytest.raises(ConfigError, match=r"without a token.*HGS_OPERATOR_TOKEN"):
        tokens_of(bare)
    assert not tokens_of(bare.model_copy(update={"access": TOKENS})).empty
    only_viewers = AccessSettings(viewer_token=VIEWER)
    with pytest.raises(ConfigError, match="none of an operator"):
        tokens_of(bare.model_copy(update={"access": only_viewers}))


def test_the_command_refuses_such_an_address_before_it_touches_anything(tmp_path):
    data = tmp_path / "data"
    answer = CliRunner().invoke(application, ["serve", "--host", "0.0.0.0", "--data-dir", str(data)])
    assert answer.exit_code == 2
    assert not data.exists()


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_this_machine_needs_none(host, tmp_path):
    assert tokens_of(Settings(data_dir=tmp_path, host=host)).empty


def test_the_environment_is_read(tmp_path):
    environment = {
        "HGS_OPERATOR_TOKEN": OPERATOR,
        "HGS_ALLOWED_HOSTS": "robot.example, 10.0.0.7",
        "HGS_DATABASE_URL": "postgresql://db/hgs",
        "HGS_VIEWER_TOKEN": "",
    }
    settings = settings_from_environment(
        host="127.0.0.1", port=8000, data_dir=tmp_path, demo=False, environment=environment
    )
    assert settings.access.allowed_hosts == ("robot.example", "10.0.0.7")
    assert settings.database == "postgresql://db/hgs"
    assert settings.access.viewer_token is None
    assert OPERATOR not in repr(settings)


@pytest.mark.parametrize("variable", ["HGS_SCENES_DIR", "HGS_TOKEN_FILE"])
def test_a_path_that_is_missing_is_an_error(tmp_path, variable):
    with pytest.raises(ConfigError, match=variable):
        settings_from_environment(
            host="127.0.0.1",
            port=8000,
            data_dir=tmp_path,
            demo=False,
            environment={variable: str(tmp_path / "nowhere")},
        )


@pytest.mark.parametrize(
    "token", ["short", " padded with blanks, but long ", "not quite ASCII, but löng enough"]
)
def test_a_weak_token_is_refused(tmp_path, token):
    settings = Settings(data_dir=tmp_path, access=AccessSettings(operator_token=token))
    with pytest.raises(ConfigError, match="HGS_OPERATOR_TOKEN"):
        tokens_of(settings)


def test_a_file_of_hashes_holds_tokens_of_many(tmp_path, service):
    made = {name: new_token(role, name) for name, role in (("alice", Role.OPERATOR), ("bob", Role.VIEWER))}
    path = tmp_path / "tokens"
    path.write_text("# who may\n\n" + "\n".join(f"{token.line}  # since May" for _, token in made.values()))
    assert all(secret not in path.read_text() for secret, _ in made.values())
    client = service(access=AccessSettings(token_file=path))
    for name, (secret, _) in made.items():
        assert client.get(f"{API}/session", headers=bearer(secret)).json()["name"] == name
    # What stands in the file is no token.
    assert client.get(f"{API}/system", headers=bearer(made["alice"][1].digest)).status_code == 401


@pytest.mark.parametrize(
    "line", ["operator alice", "admin alice sha256:" + "0" * 64, "operator alice sha256:" + "0" * 63, "x"]
)
def test_a_wrong_line_of_the_file_is_named(tmp_path, line):
    path = tmp_path / "tokens"
    path.write_text(f"# one\n{line}\n")
    with pytest.raises(ConfigError, match="line 2"):
        tokens_of(Settings(data_dir=tmp_path, access=AccessSettings(token_file=path)))


def test_two_tokens_never_share_a_name_or_a_secret(tmp_path):
    for access in (
        AccessSettings(operator_token=OPERATOR, viewer_token=OPERATOR),
        AccessSettings(operator_token=OPERATOR, token_file=tmp_path / "tokens"),
    ):
        (tmp_path / "tokens").write_text(f"viewer operator sha256:{'0' * 64}\n")
        with pytest.raises(ConfigError, match="of its own"):
            tokens_of(Settings(data_dir=tmp_path, access=access))


def test_the_command_makes_tokens_that_work(tmp_path):
    answer = CliRunner().invoke(application, ["token", "viewer", "carol"])
    assert answer.exit_code == 0, answer.output
    (tmp_path / "tokens").write_text(answer.stdout)
    secret = answer.stderr.split()[-1]
    access = AccessSettings(operator_token=OPERATOR, token_file=tmp_path / "tokens")
    found = tokens_of(Settings(data_dir=tmp_path, access=access)).identify(secret)
    assert (found.name, found.role) == ("carol", Role.VIEWER)
    for wrong in (["token", "admin", "carol"], ["token", "viewer", "a b"]):
        assert CliRunner().invoke(application, wrong).exit_code == 2
