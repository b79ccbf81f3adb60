"""``POST /v1/images``."""

import asyncio
import hashlib

import httpx
import pytest

from tests.services import samples

MEBIBYTE = 1024 * 1024


@pytest.mark.parametrize("data", samples.ACCEPTED.values(), ids=samples.ACCEPTED)
def test_upload_tells_what_it_got(client, data):
    response = client.post("/v1/images", content=data, headers={"Content-Type": "image/png"})
    digest = hashlib.sha256(data).hexdigest()
    assert response.status_code == 201
    assert response.json() == {
        "id": digest,
        "sha256": digest,
        "width": 40,
        "height": 30,
        "bytes": len(data),
    }


def test_turned_picture_has_the_size_of_the_upright_one(client):
    data = samples.encoded(format_name="JPEG", orientation=samples.TURNED_RIGHT)
    answer = client.post("/v1/images", content=data).json()
    assert (answer["width"], answer["height"]) == (30, 40)


def test_same_bytes_give_the_same_id_however_they_are_sent(client):
    data = samples.encoded()
    raw = client.post(
        "/v1/images", content=data, headers={"Content-Type": "application/octet-stream"}
    )
    part = client.post("/v1/images", files={"file": ("../../etc/passwd.png", data)})
    assert raw.status_code == part.status_code == 201
    assert raw.json() == part.json()


def test_file_name_of_a_part_goes_nowhere(client, service_settings):
    client.post("/v1/images", files={"file": ("../../escaped.png", samples.encoded())})
    kept = {path.name for path in service_settings.data_dir.parent.rglob("*") if path.is_file()}
    assert kept == {hashlib.sha256(samples.encoded()).hexdigest(), "mark"}, (
        "the folder's own mark and the picture"
    )


@pytest.mark.parametrize("data", samples.REFUSED.values(), ids=samples.REFUSED)
def test_what_is_no_whole_picture_is_refused(client, problem, data):
    problem(client.post("/v1/images", content=data), 422, "invalid_image", "image")
    problem(
        client.post("/v1/images", files={"file": ("x.png", data)}), 422, "invalid_image", "file"
    )


@pytest.mark.parametrize(
    "content_type", ["application/json", "text/plain", "application/x-www-form-urlencoded"]
)
def test_other_content_types_are_refused(client, problem, content_type):
    response = client.post(
        "/v1/images", content=samples.encoded(), headers={"Content-Type": content_type}
    )
    problem(response, 415, "unsupported_media_type")


def test_multipart_without_the_file(client, problem):
    boundary = "multipart/form-data; boundary=x"
    empty = client.post("/v1/images", content=b"--x--\r\n", headers={"Content-Type": boundary})
    problem(empty, 422, field="file")


@pytest.mark.parametrize(
    ("content_type", "body"),
    [
        ("multipart/form-data", b"--x--\r\n"),
        ("multipart/form-data; boundary=x", b""),
        ("multipart/form-data; boundary=x", b"nothing of the kind"),
        ("multipart/form-data; boundary=" + "x" * 1000, b""),
        (
            "multipart/form-data; boundary=x",
            b'--x\r\nContent-Disposition: form-data; name="file"\r\n\r\nhalf',
        ),
        ("multipart/form-data; boundary=x", b"--x\r\nX: " + b"y" * 100_000),
        ("multipart/form-data; boundary=x", b"--x\r\n\r\nnameless\r\n--x--\r\n"),
    ],
)
def test_broken_multipart(client, problem, content_type, body):
    problem(
        client.post("/v1/images", content=body, headers={"Content-Type": content_type}),
        422,
        field="body",
    )


def test_33_mebibytes_are_refused_by_their_announced_length(client, problem):
    problem(client.post("/v1/images", content=bytes(33 * MEBIBYTE)), 413, "too_large", "image")


def test_33_mebibytes_in_a_part_are_refused(client, problem):
    problem(
        client.post("/v1/images", files={"file": ("x.png", bytes(33 * MEBIBYTE))}),
        413,
        "too_large",
        "file",
    )


def test_endless_body_is_refused_while_it_streams_in(app):
    """No length is announced; of a body of 640 MiB little more than the limit of 32 is ever
    read."""
    sent = 0

    async def body():
        nonlocal sent
        for _ in range(640):
            sent += 1
            yield bytes(MEBIBYTE)

    async def upload():
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            return await client.post("/v1/images", content=body())

    response = asyncio.run(upload())
    assert response.status_code == 413
    assert response.json()["code"] == "too_large"
    assert sent <= 34


def test_the_limit_itself_is_accepted(client):
    """Bytes after a picture's end belong to the upload, but not to the picture."""
    picture = samples.encoded()
    assert client.post("/v1/images", content=picture.ljust(32 * MEBIBYTE, b"\0")).status_code == 201


def test_a_picture_is_read_once_however_many_requests_name_it(app, client, monkeypatch):
    """Each request read, and on several hosts fetched, the whole picture to learn its size."""
    uploaded = client.post("/v1/images", content=samples.encoded()).json()["id"]
    backend, read = app.state.backend, []
    get = backend.blobs.get
    monkeypatch.setattr(backend.blobs, "get", lambda blob_id: read.append(blob_id) or get(blob_id))
    backend.uploads._looked_at.clear()  # another replica took it
    segment = {"kind": "segment", "image": {"id": uploaded}}
    assert [client.post("/v1/jobs", json=segment).status_code for _ in range(3)] == [202] * 3
    assert read == [uploaded]
    backend.blobs.path(uploaded).unlink()
    backend.uploads._fresh_s = 0.0
    info, _ = backend.uploads._looked_at[uploaded]
    backend.uploads._looked_at[uploaded] = info, 0.0  # time goes by
    assert client.post("/v1/jobs", json=segment).json()["code"] == "unknown_image"


def test_a_picture_that_was_just_there_is_not_looked_for_again(app, client, monkeypatch):
    """Every request waited for a thread, and on several hosts for S3, to learn what the one before
    had learned."""
    uploaded = client.post("/v1/images", content=samples.encoded()).json()["id"]
    uploads, found = app.state.backend.uploads, []
    find = uploads._find
    monkeypatch.setattr(uploads, "_find", lambda *given: found.append(given) or find(*given))
    segment = {"kind": "segment", "image": {"id": uploaded}}
    assert [client.post("/v1/jobs", json=segment).status_code for _ in range(4)] == [202] * 4
    assert len(found) == 1
