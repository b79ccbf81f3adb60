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
