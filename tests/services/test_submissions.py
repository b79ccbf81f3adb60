"""``POST /v1/jobs``: what becomes a job, and what is said about what does not."""

import io

import numpy as np
import pytest
from dlo_client.contracts import AnyRequest, ImageRef
from pydantic import TypeAdapter

from tests.processes import KEYS
from tests.services import samples
from workers.queue import JobQueue


@pytest.fixture
def queued(job_queue: JobQueue):
    """The request as it lies in the queue."""

    def queued(response) -> AnyRequest:
        assert response.status_code == 202, response.text
        assert response.headers["Location"] == f"/v1/jobs/{response.json()['id']}"
        stored = job_queue._client.hget(KEYS.job(response.json()["id"]), "request")
        return TypeAdapter(AnyRequest).validate_json(stored)

    return queued


class TestAccepted:
    def test_a_network_that_a_worker_has(self, send, queued, announced):
        assert (
            queued(
                send({"kind": "segment", "model": "foreground_compact"}, samples.encoded())
            ).model
            is not None
        )

    def test_any_network_as_long_as_no_worker_has_announced_its_own(self, send, queued):
        assert (
            queued(send({"kind": "segment", "model": "from_tomorrow"}, samples.encoded())).model
            == "from_tomorrow"
        )

    def test_json_with_an_uploaded_picture(self, client, upload, queued):
        image = upload(samples.encoded())
        response = client.post(
            "/v1/jobs", json={"kind": "instances", "image": image, "label": "cell 3"}
        )
        assert response.json()["label"] == "cell 3"
        assert queued(response).image == ImageRef(**image)

    def test_part_fills_the_image_left_out(self, send, upload, queued):
        request = queued(send({"kind": "segment"}, samples.encoded()))
        assert request.image == ImageRef(**upload(samples.encoded()))

    def test_mask_part_beside_an_image_part(self, send, upload, queued):
        mask = samples.encoded(samples.pixels(mode="L"))
        request = queued(send({"kind": "instances"}, samples.encoded(), mask=mask))
        assert request.image == ImageRef(**upload(samples.encoded()))
        assert request.mask == ImageRef(**upload(mask))

    def test_depth_part_alone_and_beside_an_image_part(self, send, upload, queued, problem):
        camera = {"width": 40, "height": 30, "fx": 40.0, "fy": 40.0, "cx": 19.5, "cy": 14.5}
        depth, asked = samples.sixteen_bit_png(), {"kind": "instances", "intrinsics": camera}
        alone, beside = (
            queued(send(asked, depth=depth)),
            queued(send(asked, samples.encoded(), depth=depth)),
        )
        assert alone.depth == beside.depth == ImageRef(**upload(depth))
        assert (alone.image, beside.image) == (None, ImageRef(**upload(samples.encoded())))
        problem(send({"kind": "instances"}, depth=depth), 422, "invalid_request", "intrinsics")
        problem(
            send(asked, samples.encoded(samples.pixels(20, 20)), depth=depth),
            422,
            "size_mismatch",
            "depth",
        )

    def test_a_point_cloud_is_a_depth_and_no_picture(self, client, send, upload, queued, problem):
        file = io.BytesIO()
        np.save(file, np.ones((30, 40, 3), np.float32))
        cloud, asked = file.getvalue(), {"kind": "topology"}
        assert queued(send(asked, samples.encoded(), depth=cloud)).depth == ImageRef(
            **upload(cloud)
        )
        problem(
            send(asked, samples.encoded(samples.pixels(20, 20)), depth=cloud),
            422,
            "size_mismatch",
            "depth",
        )
        problem(send(asked, cloud), 422, "invalid_image", "image")
        problem(send(asked | {"image": upload(cloud)}), 422, "invalid_image", "image")

    def test_mask_alone(self, send, upload, queued):
        request = queued(send({"kind": "instances"}, mask=samples.encoded()))
        assert request.image is None
        assert request.mask == ImageRef(**upload(samples.encoded()))

    def test_fields_may_name_parts_by_number(self, send, upload, queued):
        first, second = samples.encoded(), samples.encoded(format_name="BMP")
        request = queued(send({"kind": "instances", "mask": {"part": 0}}, first, second))
        assert request.mask == ImageRef(**upload(first))
        assert request.image == ImageRef(**upload(second))

    def test_part_that_is_the_mask_is_not_the_image_too(self, send, queued):
        assert (
            queued(send({"kind": "instances", "mask": {"part": 0}}, samples.encoded())).image
            is None
        )

    def test_sizes_are_compared_upright(self, send, queued):
        turned = samples.encoded(format_name="JPEG", orientation=samples.TURNED_RIGHT)
        queued(send({"kind": "instances"}, turned, mask=samples.encoded(samples.pixels(30, 40))))

    def test_request_part_may_be_a_file(self, client, queued):
        files = {"request": ("../request.json", b'{"kind": "noop"}', "application/json")}
        queued(client.post("/v1/jobs", files=files))

    @pytest.mark.parametrize("size", [(1, 1), (8000, 20)])
    def test_extreme_shapes(self, send, queued, size):
        queued(send({"kind": "instances"}, samples.encoded(samples.pixels(*size))))


class TestViews:
    """`reconstruct`: the image of every view, each of 40 x 30 pixels."""

    def request(self, *images, **intrinsics) -> dict:
        pose = [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]
        camera = {"width": 40, "height": 30, "fx": 50, "fy": 50, "cx": 20, "cy": 15} | intrinsics
        views = [
            {"intrinsics": camera, "T_world_camera": [list(row) for row in pose]} for _ in images
        ]
        for index, (view, image) in enumerate(zip(views, images, strict=True)):
            view["T_world_camera"][0][3] = 0.1 * index
            if image is not None:
                view["image"] = image
        return {"kind": "reconstruct", "views": views}

    def test_parts_fill_the_views_in_order(self, send, upload, queued):
        first, second = samples.encoded(), samples.encoded(format_name="BMP")
        request = queued(send(self.request(None, None), first, second))
        assert [view.image for view in request.views] == [
            ImageRef(**upload(first)),
            ImageRef(**upload(second)),
        ]

    def test_a_view_may_name_a_part_or_an_uploaded_picture(self, send, upload, queued):
        first, second, third = (
            samples.encoded(format_name=name) for name in ("PNG", "BMP", "TIFF")
        )
        request = queued(send(self.request({"part": 1}, upload(third), None), first, second))
        assert [v.image for v in request.views] == [
            ImageRef(**upload(x)) for x in (second, third, first)
        ]

    def test_too_few_or_too_many_pictures(self, send, problem):
        problem(send(self.request(None, None), samples.encoded()), 422, field="views.1.image")
        problem(send(self.request(None, None), *[samples.encoded()] * 3), 422, field="image")

    def test_intrinsics_of_another_size(self, send, problem):
        response = send(self.request(None, None, width=80), *[samples.encoded()] * 2)
        body = problem(response, 422, "size_mismatch", "views.0.intrinsics")
        assert "80 x 30" in body["detail"]

    @pytest.mark.parametrize("views", [[], "views", [3, 4], [{}], None])
    def test_views_that_are_none(self, send, problem, views):
        problem(send({"kind": "reconstruct", "views": views}, samples.encoded()), 422)

    def test_one_view(self, send, problem):
        problem(send(self.request(None), samples.encoded()), 422, field="views")

    def test_poses_that_are_none(self, send, problem):
        request = self.request(None, None)
        request["views"][1]["T_world_camera"][0][0] = 2.0
        problem(send(request, *[samples.encoded()] * 2), 422, field="views.1.T_world_camera")

    def test_equal_poses(self, send, problem):
        request = self.request(None, None)
        request["views"][1]["T_world_camera"][0][3] = 0.0
        problem(send(request, *[samples.encoded()] * 2), 422, field="views")

    def test_ros_camera_info_in_either_spelling(self, send, queued):
        request = self.request(None, None)
        k = [50.0, 0, 20, 0, 50, 15, 0, 0, 1]
        message = {"width": 40, "height": 30, "distortion_model": "plumb_bob"}
        request["views"][0]["intrinsics"] = message | {"K": k, "D": [0.0] * 5, "R": [1.0] * 9}
        request["views"][1]["intrinsics"] = message | {
            "k": k,
            "d": [],
            "header": {"frame_id": "camera_optical"},
        }
        views = queued(send(request, *[samples.encoded()] * 2)).views
        assert [view.intrinsics.K for view in views] == [k, k]


class TestWebhook:
    URL = "https://cell.example:8443/ended?cell=3"

    @pytest.fixture
    def service_settings(self, service_settings):
        allowed = {
            "webhook_hosts": ("plc", "cell.example:8443"),
            "webhook_secret": "a secret of some length",
        }
        return service_settings.model_copy(update=allowed)

    @pytest.mark.parametrize("url", [URL, "http://plc:81", "http://plc"])
    def test_an_allowed_host_is_taken(self, client, queued, url):
        assert (
            queued(client.post("/v1/jobs", json={"kind": "noop", "webhook_url": url})).webhook_url
            == url
        )

    @pytest.mark.parametrize(
        "url",
        [
            "https://cell.example/ended",
            "http://169.254.0.1/",
            "http://plc.evil.example/",
            "http://plc@evil.example/",
            "http://evil.example/@plc",
            "http://[::1]/",
            "http://[plc/",
            "http://[1.2]/",
            "ftp://plc/",
            "plc",
            "",
        ],
    )
    def test_another_is_refused(self, client, problem, url):
        problem(
            client.post("/v1/jobs", json={"kind": "noop", "webhook_url": url}),
            422,
            field="webhook_url",
        )


class TestPlanShape:
    STATE = {"kind": "plan_shape", "target_m": [[0, 0], [0.3, 0.1]], "object": {"mass_kg": 0.05}}

    def test_points_need_no_picture(self, client, queued):
        """It was refused: every request with an image field had to name a picture."""
        request = queued(client.post("/v1/jobs", json=self.STATE | {"state_m": [[0, 0], [0.3, 0]]}))
        assert request.image is None

    def test_a_homography_needs_one(self, client, problem, send, queued):
        given = self.STATE | {"homography": [[0.001, 0, 0], [0, 0.001, 0], [0, 0, 1]]}
        problem(client.post("/v1/jobs", json=given), 422, field="image")
        assert queued(send(given, samples.encoded())).image is not None

    @pytest.mark.parametrize("state", [[[0, 0]], [[0, 0], [0, 0]], [[0, 0], ["x", 0]], "line"])
    def test_a_state_that_is_no_line_is_named(self, client, problem, state):
        found = problem(client.post("/v1/jobs", json=self.STATE | {"state_m": state}), 422)
        assert found["errors"][0]["field"].startswith("state_m")
