"""OpenStack Swift with its S3 API, all four servers in this process.

`python -m tests.servers.swift_server FOLDER ACCOUNT_PORT CONTAINER_PORT OBJECT_PORT S3_PORT`. A real S3 server:
signatures and expiries are checked, data is on disk. Prints "ready" when all four listen.
"""

# ruff: noqa: E402 - eventlet patches the standard library before anything else imports it

import eventlet

eventlet.monkey_patch()

import contextlib
import ctypes
import getpass
import os
import signal
import sys
from pathlib import Path

from eventlet import wsgi
from paste.deploy import loadapp
from swift.common.ring import RingBuilder
from swift.common.utils import set_swift_dir

ACCESS_KEY = "test:tester"
SECRET_KEY = "testing"
REGION = "us-east-1"
KINDS = ("account", "container", "object")

SWIFT_CONF = """
[swift-hash]
swift_hash_path_prefix = marey
swift_hash_path_suffix = marey
[storage-policy:0]
name = gold
default = yes
"""

COMMON = """
[DEFAULT]
bind_ip = 127.0.0.1
bind_port = {port}
workers = 0
swift_dir = {folder}
devices = {folder}/data
mount_check = false
user = {user}
log_address = /nonexistent
"""

STORAGE = """
[pipeline:main]
pipeline = {kind}-server
[app:{kind}-server]
use = egg:swift#{kind}
"""

PROXY = f"""
[pipeline:main]
pipeline = catch_errors proxy-logging cache listing_formats bulk tempurl s3api tempauth container_quotas slo dlo \
versioned_writes symlink copy proxy-logging proxy-server
[app:proxy-server]
use = egg:swift#proxy
allow_account_management = true
account_autocreate = true
[filter:catch_errors]
use = egg:swift#catch_errors
[filter:proxy-logging]
use = egg:swift#proxy_logging
[filter:cache]
use = egg:swift#memcache
[filter:listing_formats]
use = egg:swift#listing_formats
[filter:bulk]
use = egg:swift#bulk
[filter:tempurl]
use = egg:swift#tempurl
[filter:s3api]
use = egg:swift#s3api
location = {REGION}
s3_acl = false
[filter:tempauth]
use = egg:swift#tempauth
user_test_tester = {SECRET_KEY} .admin
[filter:container_quotas]
use = egg:swift#container_quotas
[filter:slo]
use = egg:swift#slo
min_segment_size = 1
[filter:dlo]
use = egg:swift#dlo
[filter:versioned_writes]
use = egg:swift#versioned_writes
allow_object_versioning = true
[filter:symlink]
use = egg:swift#symlink
[filter:copy]
use = egg:swift#copy
"""


def write_configuration(folder: Path, ports: dict[str, int]) -> None:
    """Rings with one replica on one device, and a file for each server."""
    (folder / "data" / "d1").mkdir(parents=True, exist_ok=True)
    (folder / "swift.conf").write_text(SWIFT_CONF)
    for kind, port in ports.items():
        values = {"port": port, "folder": folder, "user": getpass.getuser(), "kind": kind}
        body = PROXY if kind == "proxy" else STORAGE.format(**values)
        (folder / f"{kind}.conf").write_text(COMMON.format(**values) + body)
    for kind in KINDS:
        ring = RingBuilder(part_power=4, replicas=1, min_part_hours=0)
        ring.add_dev(
            {"id": 0, "region": 1, "zone": 1, "ip": "127.0.0.1", "port": ports[kind], "device": "d1", "weight": 1.0}
        )
        ring.rebalance()
        ring.get_ring().save(str(folder / f"{kind}.ring.gz"))


def main(folder: Path, ports: dict[str, int]) -> None:
    """Serve until a signal."""
    if sys.platform == "linux":
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)
    parent = os.getppid()
    write_configuration(folder, ports)
    set_swift_dir(str(folder))
    for kind in (*KINDS, "proxy"):
        listening = eventlet.listen(("127.0.0.1", ports[kind]))
        eventlet.spawn(
            wsgi.server, listening, loadapp(f"config:{folder / f'{kind}.conf'}"), log_output=False, max_size=64
        )
    print("ready", flush=True)
    with contextlib.suppress(KeyboardInterrupt):
        while os.getppid() == parent:
            eventlet.sleep(1)


if __name__ == "__main__":
    names = (*KINDS, "proxy")
    main(Path(sys.argv[1]), dict(zip(names, map(int, sys.argv[2:]), strict=True)))
