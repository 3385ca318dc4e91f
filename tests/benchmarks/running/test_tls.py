"""A run over tls, with certificates of our own, on this machine."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.running import environment
from benchmarks.store.results import Store

from .test_executors import wait_until

pytest.importorskip("distributed")


@pytest.mark.long
@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates")
def test_a_run_over_tls_gives_the_rows_of_a_local_one(tmp_path: Path) -> None:
    """As docs/SCALE.md says; who has no certificate is not let in."""
    key, certificate, file = (tmp_path / name for name in ("key.pem", "own.pem", "scheduler.json"))
    made = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost"]
    files = ["-keyout", str(key), "-out", str(certificate)]
    subprocess.run([*made, *files], check=True, capture_output=True)
    settings = {"CA_FILE": certificate}
    for role in ("CLIENT", "SCHEDULER", "WORKER"):
        settings |= {f"{role}__KEY": key, f"{role}__CERT": certificate}
    prefix = "DASK_DISTRIBUTED__COMM__TLS__"
    variables = os.environ | {f"{prefix}{name}": str(path) for name, path in settings.items()}
    processes = []

    def start(*arguments: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, "-m", *arguments],
            cwd=environment.ROOT,
            env=variables,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        processes.append(process)
        return process

    try:
        here = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--protocol", "tls"]
        start("distributed.cli.dask_scheduler", *here, "--scheduler-file", str(file))
        wait_until(lambda: file.exists() and file.read_text())
        address = json.loads(file.read_text())["address"]
        assert address.startswith("tls://")
        one = ["--no-nanny", "--nthreads", "1", "--no-dashboard", "--protocol", "tls"]
        start(
            "distributed.cli.dask_worker", address, *one, "--local-directory", str(tmp_path / "w")
        )
        command = ["-m", "benchmarks", "run", "--cases", "half_cylinder", "--methods", "tutte"]
        options = ["--executor", f"dask+{address}", "--memory", "1"]
        for folder, given in (("near", []), ("far", options)):
            done = subprocess.run(
                [sys.executable, *command, *given, "--out", str(tmp_path / folder)],
                env=variables,
                capture_output=True,
                check=False,
            )
            assert done.returncode == 0, done.stderr
        hashes = [Store(tmp_path / folder).rows()[0].uv_sha256 for folder in ("near", "far")]
        assert hashes[0] == hashes[1] != ""
        refused = subprocess.run(
            [sys.executable, *command, *options, "--seeds", "1", "--out", str(tmp_path / "no")],
            env=os.environ,
            capture_output=True,
            text=True,
            check=False,
        )
        assert refused.returncode == 2
        assert "dask is told of no certificates" in refused.stderr
    finally:
        for process in processes:
            process.kill()
            process.wait()
