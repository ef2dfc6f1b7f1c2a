"""Requests of every operation, well-formed and not; each answer must keep to the interface's description.

    python -m tests.app.wild_requests URL MISSION... --examples 12 [--same]

A process of its own, beside the service's: Hypothesis draws constants from the modules that are loaded and
walks through them, so in a process that also serves (or ran other tests before) the requests differ from run
to run, and a module that the service loads at that moment can end the walk with an error.

Schemathesis checks status, media type, schema, headers, and that what breaks the schema is refused; what a
schema cannot say (which presets there are) may be refused, with reasons.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

ENDLESS = "streamEvents"
"""A stream of events never ends; `test_streams.py` reads it."""
NAMES_THINGS = {"createMission", "savePreset", "getPresetSettings", "putDirectives", "decideApproval"}
"""Operations that say more than a schema can check: names of scenes, presets, planners and settings that
there may not be, outlines that cross themselves."""


def send_wild_requests(url: str, missions: list[str], *, token: str, examples: int, same: bool) -> int:
    """Send them from a process of its own; `same`: the same ones in every run. Returns how many were sent.

    Raises AssertionError with what that process printed, when an answer is off the description.
    """
    command = [sys.executable, "-m", "tests.app.wild_requests", url, *missions, "--examples", str(examples)]
    ended = subprocess.run(
        [*command, *(["--same"] if same else [])],
        env={**os.environ, "PYTHONHASHSEED": "0", "HGS_TOKEN": token},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout[-6_000:]
    return int(ended.stdout.splitlines()[-1])


def _send(url: str, missions: list[str], *, token: str, examples: int, same: bool) -> int:
    headers = {"Authorization": f"Bearer {token}"}
    description = schemathesis.openapi.from_url(f"{url}openapi.json", headers=headers)
    sent = 0
    for found in description.exclude(operation_id=ENDLESS).get_all_operations():
        operation = found.ok()
        cases = operation.as_strategy() | operation.as_strategy(
            generation_mode=schemathesis.GenerationMode.NEGATIVE
        )

        @settings(
            max_examples=examples,
            deadline=None,
            database=None,
            derandomize=same,
            phases=[Phase.generate, Phase.shrink],
            suppress_health_check=list(HealthCheck),
        )
        @given(case=cases, mission=st.sampled_from([None, *missions]))
        def send(case, mission):
            nonlocal sent
            sent += 1
            well_formed = case.meta.generation.mode is schemathesis.GenerationMode.POSITIVE
            if mission is not None and well_formed and "mission_id" in case.path_parameters:
                case.path_parameters["mission_id"] = mission
            answer = case.call(headers=headers, timeout=60)
            excluded = []
            if answer.status_code == 422 and case.operation.definition.raw["operationId"] in NAMES_THINGS:
                assert answer.json()["errors"]
                excluded.append(schemathesis.checks.CHECKS.get_one("positive_data_acceptance"))
            case.validate_response(answer, excluded_checks=excluded)

        send()
    return sent


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("url", help="where the service is, with a slash at its end")
    parser.add_argument("missions", nargs="+", help="missions that there are")
    parser.add_argument("--examples", type=int, required=True, help="requests of each operation, at most")
    parser.add_argument("--same", action="store_true", help="the same requests in every run")
    wanted = parser.parse_args()
    sent = _send(
        wanted.url,
        wanted.missions,
        token=os.environ["HGS_TOKEN"],
        examples=wanted.examples,
        same=wanted.same,
    )
    print(sent)  # noqa: T201


if __name__ == "__main__":
    main()
