import pytest
from pydantic import ValidationError

from workers.settings import Settings


def test_settings_come_from_the_environment(monkeypatch):
    monkeypatch.setenv("DLO_REDIS_URL", "redis://queue:6379/3")
    monkeypatch.setenv("DLO_ONNX_PROVIDERS", '["CUDAExecutionProvider", "CPUExecutionProvider"]')
    settings = Settings()
    assert settings.redis_url == "redis://queue:6379/3"
    assert settings.onnx_providers == ["CUDAExecutionProvider", "CPUExecutionProvider"]


def test_blobs_must_outlive_the_jobs_that_use_them():
    with pytest.raises(ValidationError, match="DLO_BLOB_TTL_S"):
        Settings(blob_ttl_s=3600)


def test_files_that_a_deployment_leaves_empty_are_none(monkeypatch):
    monkeypatch.setenv("DLO_REDIS_PASSWORD_FILE", "")
    assert Settings().redis_password_file is None


@pytest.mark.parametrize(
    "url", ["http://bucket", "s3://", "s3://b", "s3://Bucket", "bucket/folder", "s3://bucket/a b"]
)
def test_a_place_for_blobs_that_is_none_is_refused(url):
    with pytest.raises(ValidationError, match="blobs_url"):
        Settings(blobs_url=url)


@pytest.mark.parametrize("prefix", ["", "Dlo", "a:b", "*", "x" * 33])
def test_prefixes_are_names(prefix):
    with pytest.raises(ValidationError, match="queue_prefix"):
        Settings(queue_prefix=prefix)
