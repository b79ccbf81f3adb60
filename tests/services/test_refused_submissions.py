"""Requests that are refused, and what the caller reads."""

from __future__ import annotations

import json

import pytest

from tests.services import samples
from tests.services.samples import JSON


class TestRefused:
    @pytest.mark.parametrize("data", samples.REFUSED.values(), ids=samples.REFUSED)
    def test_what_is_no_whole_picture(self, send, problem, data):
        problem(send({"kind": "instances"}, data), 422, "invalid_image", "image")
        problem(
            send({"kind": "instances"}, samples.encoded(), mask=data), 422, "invalid_image", "mask"
        )

    @pytest.mark.parametrize(
        ("field", "request_fields"),
        [
            ("kind", {"kind": "knot"}),
            ("kind", {"kind": None}),
            ("kind", {"kind": 3}),
            ("method", {"method": "magic"}),
            ("model", {"model": "../../etc/passwd"}),
            ("params", {"params": "fast"}),
            ("params.sampling_ratio", {"params": {"sampling_ratio": float("nan")}}),
            ("params.sampling_ratio", {"params": {"sampling_ratio": float("inf")}}),
            ("params.sampling_ratio", {"params": {"sampling_ratio": -0.1}}),
            ("params.neighbors", {"params": {"neighbors": 10**30}}),
            ("params.neighbors", {"params": {"neighbors": "many"}}),
            ("params.instances", {"params": {"instances": 1}}),
            ("threshold", {"threshold": float("-inf")}),
            ("timeout_s", {"timeout_s": 1e300}),
            ("timeout_s", {"timeout_s": -1}),
            ("points_per_instance", {"points_per_instance": 1}),
            ("priority", {"priority": "urgent"}),
            ("label", {"label": "x" * 201}),
            ("files.1", {"files": ["overlay", "passwd"]}),
            ("instances", {"instances": 1}),
            ("image", {"image": "cable.png"}),
            ("image.id", {"image": {"id": "../../etc/passwd"}}),
            ("image.id", {"image": {}}),
            ("image.part", {"image": {"part": -1}}),
            ("image.part", {"image": {"part": 0.5}}),
            ("image", {"image": {"part": 0}}),
            ("image", {"image": None}),
        ],
    )
    def test_field_at_fault_is_named(self, client, problem, field, request_fields):
        body = json.dumps({"kind": "instances"} | request_fields)
        problem(client.post("/v1/jobs", content=body, headers=JSON), 422, field=field)

    def test_only_the_nearest_form_of_an_image_is_reported(self, client, problem):
        response = client.post("/v1/jobs", json={"kind": "segment", "image": {"part": 99}})
        assert [error["field"] for error in problem(response, 422)["errors"]] == ["image.part"]

    def test_all_fields_at_fault_are_named(self, client, problem):
        response = client.post(
            "/v1/jobs", json={"kind": "noop", "hold_s": -1, "label": 3, "color": "red"}
        )
        named = [error["field"] for error in problem(response, 422)["errors"]]
        assert sorted(named) == ["color", "hold_s", "label"]

    def test_rule_between_fields_names_the_field(self, send, problem):
        response = send({"kind": "instances", "model": "net"}, mask=samples.encoded())
        problem(response, 422, field="model")

    @pytest.mark.parametrize("kind", ["segment", "instances", "topology", "plan_disentangle"])
    @pytest.mark.parametrize("model", ["foreground_compact_v9", "topology"])
    def test_a_network_that_no_worker_has(self, client, send, problem, announced, kind, model):
        """An unknown name was found in the worker only, by a job that had waited for its turn."""
        found = problem(
            send({"kind": kind, "model": model}, samples.encoded()), 422, "invalid_model", "model"
        )
        assert "foreground_compact" in found["detail"]
        assert client.get("/v1/jobs").json()["jobs"] == []

    def test_a_network_in_a_large_request(self, send, problem, announced):
        request = {
            "kind": "topology",
            "model": "other",
            "points": [{"xy": [1, 2], "depth_m": 1}] * 2000,
        }
        problem(send(request, samples.encoded()), 422, "invalid_model", "model")

    def test_neither_image_nor_mask(self, client, send, problem):
        problem(client.post("/v1/jobs", json={"kind": "instances"}), 422, field="image")
        problem(send({"kind": "segment"}), 422, field="image")

    def test_picture_that_was_never_uploaded(self, client, problem):
        for field in ("image", "mask"):
            response = client.post("/v1/jobs", json={"kind": "instances", field: {"id": "0" * 64}})
            problem(response, 422, "unknown_image", field)

    def test_mask_of_another_size(self, client, upload, send, problem):
        image, mask = samples.encoded(), samples.encoded(samples.pixels(30, 40))
        problem(send({"kind": "instances"}, image, mask=mask), 422, "size_mismatch", "mask")
        request = {"kind": "instances", "image": upload(image), "mask": upload(mask)}
        problem(client.post("/v1/jobs", json=request), 422, "size_mismatch", "mask")

    def test_mask_given_twice(self, upload, send, problem):
        request = {"kind": "instances", "mask": upload(samples.encoded())}
        problem(send(request, mask=samples.encoded()), 422, field="mask")

    def test_picture_that_the_request_does_not_use(self, upload, send, problem):
        problem(send({"kind": "segment"}, samples.encoded(), samples.encoded()), 422, field="image")
        problem(send({"kind": "noop"}, samples.encoded()), 422, field="image")

    def test_65_pictures(self, send, problem):
        response = send({"kind": "instances"}, *[samples.encoded()] * 65)
        assert "64" in problem(response, 422, "too_many_parts", "image")["detail"]

    def test_33_mebibytes(self, send, problem):
        huge = bytes(33 * 1024 * 1024)
        problem(send({"kind": "instances"}, huge), 413, "too_large", "image")
        problem(send({"kind": "instances"}, samples.encoded(), mask=huge), 413, "too_large", "mask")

    def test_request_part_missing_or_unknown_part(self, client, send, problem):
        problem(send(None, samples.encoded()), 422, field="request")
        problem(client.post("/v1/jobs", files={"picture": ("x", b"")}), 422, field="picture")

    @pytest.mark.parametrize(
        "body", [b"", b"{", b"kind=noop", b"\xff\xfe", b"[" * 100_000, b'{"a": "\\ud800"}']
    )
    def test_not_json(self, client, problem, body):
        problem(client.post("/v1/jobs", content=body, headers=JSON), 422, "invalid_json", "body")
        response = client.post("/v1/jobs", files={"request": ("request", body)})
        problem(response, 422, "invalid_json", "request")

    @pytest.mark.parametrize("body", [b"[]", b'"noop"', b"null", b"3"])
    def test_json_of_another_kind(self, client, problem, body):
        problem(client.post("/v1/jobs", content=body, headers=JSON), 422, field="body")

    @pytest.mark.parametrize("content_type", ["text/plain", "image/png", "application/xml", ""])
    def test_wrong_content_type(self, client, problem, content_type):
        headers = {"Content-Type": content_type}
        response = client.post("/v1/jobs", content=b'{"kind": "noop"}', headers=headers)
        problem(response, 415, "unsupported_media_type")

    def test_json_larger_than_its_limit(self, client, problem, service_settings):
        body = b'{"kind": "noop", "label": "' + b"x" * service_settings.max_request_bytes + b'"}'
        problem(client.post("/v1/jobs", content=body, headers=JSON), 413, "too_large", "body")

    @pytest.mark.parametrize("wait", ["61", "-1", "nan", "inf", "soon"])
    def test_wait_out_of_range(self, client, problem, wait):
        problem(client.post(f"/v1/jobs?wait={wait}", json={"kind": "noop"}), 422, field="wait")

    def test_nothing_refused_is_queued(self, client, send, job_queue):
        send({"kind": "instances"}, b"")
        client.post("/v1/jobs", json={"kind": "knot"})
        assert sum(job_queue.depth().values()) == 0
