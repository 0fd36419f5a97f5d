"""Object storage: batch from and to a bucket, rescore from it, on a server of the test's own."""

from __future__ import annotations

import os
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from formats.errors import FormatError
from replay import batch, rescore
from replay.archive import places
from replay.cli import _exit_code
from tests.faults_world import drive

pytestmark = pytest.mark.filterwarnings("ignore")  # of the server's libraries


@pytest.fixture
def bucket(home: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An address in an empty bucket of a server of its own, with nothing in our cache."""
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "testing")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    monkeypatch.setenv("XDG_CACHE_HOME", str(home / "cache"))
    import s3fs

    reset = urllib.request.Request(f"http://{host}:{port}/moto-api/reset", method="POST")
    urllib.request.urlopen(reset).close()
    s3fs.S3FileSystem.clear_instance_cache()
    s3fs.S3FileSystem().mkdir("lab")
    yield "s3://lab"
    s3fs.S3FileSystem.clear_instance_cache()
    server.stop()


def upload(folder: Path, address: str) -> None:
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            places.put(path, f"{address}/{path.relative_to(folder).as_posix()}")


def rows(scored: Any) -> list[dict[str, Any]]:
    """Without where the log lay."""
    return [{k: v for k, v in row.items() if k != "log"} for row in scored.rows]


def test_from_a_bucket_to_a_bucket_and_scored_there(bucket: str, home: Path) -> None:
    upload(home / "logs", f"{bucket}/logs")
    for name in ("plan.png", "plan.yaml"):
        places.put(home / name, f"{bucket}/plans/{name}")
    words = {"prior": f"{bucket}/plans/plan.png"}
    far = batch(f"{bucket}/logs", f"{bucket}/runs", **words)
    near = batch("logs", "runs", prior="plan.png")
    assert list(far.done) == list(near.done) == ["1", "2", "b/1", "b/3"]
    names = list(places.listed(f"{bucket}/runs"))
    assert names == [f"{name}.replay.mcap" for name in far.done]  # no ledger, nothing torn
    assert rows(rescore(f"{bucket}/runs", p_wall=0.3)) == rows(rescore("runs", p_wall=0.3))
    # Only what is missing; the ledger is here, and can be rebuilt from what is there.
    places.remove(f"{bucket}/runs/2.replay.mcap")
    again = batch(f"{bucket}/logs", f"{bucket}/runs", **words)
    assert (list(again.done), sorted(again.kept)) == (["2"], ["1", "b/1", "b/3"])
    for ledger in (home / "cache").rglob(".ledger*"):
        ledger.unlink()
    assert len(batch(f"{bucket}/logs", f"{bucket}/runs", **words).kept) == 4
    # A log that fails leaves its note there.
    drive(0).write(home / "bare.mcap")
    places.put(home / "bare.mcap", f"{bucket}/logs/bare.mcap")
    assert list(batch(f"{bucket}/logs", f"{bucket}/runs", **words).failed) == ["bare"]
    assert "bare.failed.json" in places.listed(f"{bucket}/runs")
    assert list(rescore(f"{bucket}/runs").failed) == ["bare"]


def test_a_manifest_in_a_bucket(bucket: str, home: Path) -> None:
    upload(home / "logs", f"{bucket}/logs")
    for name in ("plan.png", "plan.yaml"):
        places.put(home / name, f"{bucket}/{name}")
    (home / "jobs.csv").write_text("log,plan,name\nlogs/1.mcap,plan.png,one\n")
    places.put(home / "jobs.csv", f"{bucket}/jobs.csv")
    assert list(batch(f"{bucket}/jobs.csv", "runs").done) == ["one"]


def test_the_cache_is_bounded_and_knows_changes(bucket: str, home: Path) -> None:
    for number in range(4):
        (home / "x").write_bytes(bytes([number]) * 1000)
        places.put(home / "x", f"{bucket}/{number}.bin")
    cache = home / "cache" / "plan-replay" / "fetched"
    for number in range(4):
        path = places.fetch(f"{bucket}/{number}.bin", limit=2500)
        assert path.read_bytes() == bytes([number]) * 1000
        assert path.name == f"{number}.bin"
        os.utime(path, (number, number))
        held = [file.name for file in cache.rglob("*") if file.is_file()]
        assert sum(file.stat().st_size for file in cache.rglob("*.bin")) <= 2500
    assert sorted(held) == ["2.bin", "3.bin"]
    (home / "x").write_bytes(b"other")
    places.put(home / "x", f"{bucket}/3.bin")
    assert places.fetch(f"{bucket}/3.bin").read_bytes() == b"other"


def test_errors_are_one_line(bucket: str, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (
        ["rescore", f"{bucket}/nothing.replay.mcap"],
        ["rescore", "s3://nobucket/runs"],
        ["rescore", "odd://place/x"],
        ["batch", f"{bucket}/nothing", "-o", "runs"],
    ):
        code = _exit_code(words)
        said = capsys.readouterr()
        assert code in (1, 3), (words, said)
        assert len((said.err if code == 1 else said.out).splitlines()) <= 2, said
        assert "Traceback" not in said.err


def test_a_library_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import fsspec

    def missing(address: str) -> None:
        raise ImportError("Install s3fs to access S3")

    monkeypatch.setattr(fsspec.core, "url_to_fs", missing)
    with pytest.raises(FormatError, match=r'pip install "plan-replay\[s3\]"'):
        places.listed("s3://lab/runs")
    with pytest.raises(FormatError, match="Install s3fs to access S3"):
        places.listed("gs://lab/runs")
