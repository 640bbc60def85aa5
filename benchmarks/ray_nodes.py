"""A Ray cluster of three node processes on this machine runs a sweep, and one of them is killed on the way.

python benchmarks/ray_nodes.py SWEEP.toml   (needs pip install 'multimodal-to[ray]')

The same sweep runs with processes first. Exit status 0 when both have the same rows to the last digit, but for times.
"""

import os
import signal
import sys
import tempfile
import threading
import time
from pathlib import Path

import ray
from ray.cluster_utils import Cluster

import multimodal_to as mt
from multimodal_to.sweeping.folder import Folder

NODES = 3  # the head, which has no processor to give, is one more
TIMES = ("seconds", "solve_seconds", "cpu_seconds", "attempts")


def rows(folder: Path, count: int) -> list[dict]:
    """Return the rows of a sweep, without what depends on the machine's load."""
    return [{key: value for key, value in row.items() if key not in TIMES} for row in Folder(path=folder).rows(count)]


def killed(cluster: Cluster, folder: Path, done: int) -> None:
    """Kill the process of a node, and with it its workers, when so many plans are done.

    Args:
        cluster: of the nodes.
        folder: of the sweep.
        done: so many plans.
    """
    while len(list((folder / "rows").rglob("*.json"))) < done:
        time.sleep(0.1)
    node = next(iter(cluster.worker_nodes))
    (raylet,) = node.all_processes["raylet"]
    os.kill(raylet.process.pid, signal.SIGKILL)
    print(f"SIGKILL to a node of {NODES} when {done} plans are done", flush=True)


def main() -> int:
    """Make a sweep twice and compare."""
    design = mt.sweeping.read_design(sys.argv[1])
    with tempfile.TemporaryDirectory() as scratch:
        here, there = Path(scratch) / "processes", Path(scratch) / "ray"
        mt.sweep(design, here)
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
        for _ in range(NODES):
            cluster.add_node(num_cpus=1)
        ray.init(address=cluster.address, log_to_driver=False)
        threading.Thread(target=killed, args=(cluster, there, design.count // 3), daemon=True).start()
        counts = mt.sweep(design, there, engine="ray")
        left = sum(node["Alive"] for node in ray.nodes()) - 1
        same = rows(here, design.count) == rows(there, design.count)
        print(f"{counts.done} of {design.count} plans done, {counts.failed} failed, with {left} of {NODES} nodes left")
        print("same rows as with processes" if same else "OTHER rows than with processes")
        ray.shutdown()
        cluster.shutdown()
    return 0 if same and counts.done == design.count and left == NODES - 1 else 1


if __name__ == "__main__":
    sys.exit(main())
