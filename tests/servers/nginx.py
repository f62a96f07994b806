"""The nginx of this machine with `deploy/nginx/marey.conf`: only names, certificates and addresses are replaced."""

from __future__ import annotations

import os
import shutil
import ssl
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from tests.servers.ports import free_ports
from tests.servers.receiver import Authority

CONFIGURATION = Path(__file__).resolve().parents[2] / "deploy" / "nginx" / "marey.conf"
PROGRAM = shutil.which("nginx", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin")
START_SECONDS = 20.0
MAIN = """
{user}
daemon off;
pid {folder}/nginx.pid;
error_log {folder}/error.log;
events {{}}
http {{
    access_log {folder}/access.log;
    client_body_temp_path {folder}/body;
    proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/fastcgi;
    uwsgi_temp_path {folder}/uwsgi;
    scgi_temp_path {folder}/scgi;
    include {folder}/marey.conf;
}}
"""


class Nginx:
    """Serves until the end of the `with` block.

    Args:
        folder: of its files.
        authority: signs its certificate for `localhost`.
        api, store: host and port behind it.
        store_port: for the store; None = a free one.
        edit: changes the configuration, as an operator who leaves something out.

    Attributes:
        port, store_port, http_port: for the API and for the store by TLS, and for plain HTTP.
    """

    def __init__(
        self,
        folder: Path,
        authority: Authority,
        *,
        api: str,
        store: str,
        store_port: int | None = None,
        edit: Callable[[str], str] = lambda text: text,
    ) -> None:
        self.folder = folder
        self.http_port, self.port, spare = free_ports(3)
        self.store_port = store_port or spare
        folder.mkdir()
        chain, key = authority.files("localhost")
        text = edit(CONFIGURATION.read_text(encoding="utf-8"))
        api_part, comment, store_part = text.partition("# Where MAREY_STORE")
        for there, here in (
            ("listen 80;", f"listen 127.0.0.1:{self.http_port};"),
            ("127.0.0.1:8400", api),
            ("server_name marey.example.com", "server_name localhost"),
            ("listen 443", f"listen 127.0.0.1:{self.port}"),
        ):
            assert there in api_part, there
            api_part = api_part.replace(there, here)
        for there, here in (
            ("listen 443", f"listen 127.0.0.1:{self.store_port}"),
            ("objects.example.com", "localhost"),
            ("127.0.0.1:9000", store),
        ):
            assert there in store_part, there
            store_part = store_part.replace(there, here)
        text = api_part + comment + store_part
        for name in ("marey", "objects"):
            text = text.replace(f"/etc/nginx/tls/{name}.pem", str(chain)).replace(
                f"/etc/nginx/tls/{name}.key", str(key)
            )
        (folder / "marey.conf").write_text(text)
        user = "user root;" if os.geteuid() == 0 else ""  # else its workers cannot enter the test's folder
        (folder / "nginx.conf").write_text(MAIN.format(user=user, folder=folder))

    @property
    def url(self) -> str:
        """Of the API."""
        return f"https://localhost:{self.port}"

    def __enter__(self) -> Nginx:
        assert PROGRAM is not None
        command = [PROGRAM, "-p", str(self.folder), "-e", str(self.folder / "start.log")]
        self._process = subprocess.Popen([*command, "-c", str(self.folder / "nginx.conf")])
        deadline = time.monotonic() + START_SECONDS
        while not self._answers():
            assert self._process.poll() is None, (self.folder / "start.log").read_text()
            assert time.monotonic() < deadline, "nginx does not start"
            time.sleep(0.05)
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(20)

    def _answers(self) -> bool:
        try:
            ssl.get_server_certificate(("127.0.0.1", self.port), timeout=5)
        except OSError:
            return False
        return True
