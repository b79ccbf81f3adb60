"""What is deployed beside the service names what there is: metrics, settings, images."""

from __future__ import annotations

import json
import re

import pytest
import yaml
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.parser import text_string_to_metric_families

from services.metrics import RequestDurations, registry
from services.settings import ServiceSettings
from tests.processes import ROOT
from workers.measures import HISTOGRAMS
from workers.queue import JobQueue

DEPLOY = ROOT / "deploy"
_METRIC = re.compile(r"\b(?:dlo|process)_\w+")


@pytest.fixture
def exported(job_queue: JobQueue) -> set[str]:
    """Names of all series that the service may export."""
    made: CollectorRegistry = registry(job_queue)
    RequestDurations(made)
    names = set()
    for family in text_string_to_metric_families(generate_latest(made).decode()):
        suffixes = {"counter": ("_total",), "histogram": ("_bucket", "_sum", "_count")}.get(
            family.type, ("",)
        )
        names |= {family.name + suffix for suffix in suffixes}
    assert {f"dlo_job_{name}_seconds_bucket" for name in HISTOGRAMS} <= names
    return names


def expressions(node) -> list[str]:
    if isinstance(node, dict):
        own = [node["expr"]] if isinstance(node.get("expr"), str) else []
        return own + [text for inner in node.values() for text in expressions(inner)]
    return [text for inner in node for text in expressions(inner)] if isinstance(node, list) else []


@pytest.mark.parametrize("name", ["grafana.json", "alerts.yaml"])
def test_what_is_asked_of_prometheus_is_exported(exported, name):
    text = (DEPLOY / name).read_text()
    asked = expressions(json.loads(text) if name.endswith("json") else yaml.safe_load(text))
    assert len(asked) >= 10
    for expression in asked:
        metrics = set(_METRIC.findall(expression)) - {"dlo_up"}
        assert metrics <= exported, expression
        assert metrics or expression.startswith("up{")


@pytest.mark.parametrize("name", ["grafana.json", "alerts.yaml"])
def test_what_every_replica_exports_is_not_summed_over_replicas(name):
    """Two replicas of the service would show twice as many jobs as there were."""
    text = (DEPLOY / name).read_text()
    for expression in expressions(
        json.loads(text) if name.endswith("json") else yaml.safe_load(text)
    ):
        for found in re.finditer(r"(?:rate|increase)\(dlo_(?!http_)", expression):
            assert expression[: found.start()].endswith("max without (instance, pod) ("), expression
        for found in re.finditer(r"dlo_(?:queue|workers?|version)\w*", expression):
            assert re.search(r"(max|count)( by \([^()]*\) )?\($", expression[: found.start()]), (
                expression
            )


def test_every_alert_says_what_to_do():
    (group,) = yaml.safe_load((DEPLOY / "alerts.yaml").read_text())["groups"]
    for rule in group["rules"]:
        assert rule["annotations"]["summary"]
        assert rule["annotations"]["action"], rule["alert"]
        assert rule["labels"]["severity"] in ("page", "ticket")


def test_panels_do_not_overlap_and_are_explained():
    panels = json.loads((DEPLOY / "grafana.json").read_text())["panels"]
    places = {(panel["gridPos"]["x"], panel["gridPos"]["y"]) for panel in panels}
    assert len(places) == len(panels)
    assert all(panel["description"] for panel in panels)


COMPOSE = (ROOT / "docker-compose.yml", DEPLOY / "three-hosts.yaml")
_ELSEWHERE = {
    "DLO_URL",
    "DLO_QUEUE_SECRET",
    "DLO_IMAGE",
    "DLO_KEYS",
    "DLO_TESTS_NEED",
    "DLO_QUEUE_PASSWORD",
}
"""Variables of compose files, of tests and of the client; no settings."""


_NAMING = (*COMPOSE, DEPLOY / "gpu.yaml", ROOT / "Dockerfile", ROOT / "docs" / "deployment.md")


@pytest.mark.parametrize("file", _NAMING, ids=lambda f: f.name)
def test_every_setting_that_is_named_exists(file):
    """A variable that nobody reads is passed over without a word."""
    named = set(re.findall(r"\bDLO_[A-Z0-9_]+\b", file.read_text())) - _ELSEWHERE
    assert named
    assert {name.removeprefix("DLO_").lower() for name in named} <= set(
        ServiceSettings.model_fields
    )


@pytest.mark.parametrize("file", COMPOSE, ids=lambda file: file.name)
def test_what_is_ours_runs_confined(file):
    services = yaml.safe_load(file.read_text())["services"]
    for name in ("service", "worker"):
        part = services[name]
        assert part["read_only"] is True
        assert part["cap_drop"] == ["ALL"]
        assert "no-new-privileges:true" in part["security_opt"]
        assert "/tmp" in part["tmpfs"]
        assert part["environment"]["DLO_REDIS_PASSWORD_FILE"].startswith("/run/secrets/")
