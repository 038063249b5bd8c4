"""Small runs of `palpate experiment several-servers` and `large-content` on three NATS servers.

Called by `tests/nats` with the program.
"""

import json
import sys

from nats_servers import cluster, palpate

# Figures of a folder, and of one to three servers on the cluster.
PER_SERVERS = ("readings_per_second", "p50_ms", "p99_ms")
RATIOS = ("rate_ratio", "p99_ratio")


def main():
    """Checks that every figure is there and makes sense."""
    with cluster() as (folder, address, _):
        experiment = ["experiment", "several-servers", "--nats", f"{address}/measured"]
        small = ["--readings", "64", "--train-readings", "60", "--no-record", "--json"]
        printed = palpate(*experiment, *small, "--out", f"{folder}/results")
        figures = json.loads(printed)["figures"]
        stores = ("sled", "nats_1", "nats_2", "nats_3")
        wanted = [f"{figure}_{store}" for figure in PER_SERVERS for store in stores]
        wanted += [f"{ratio}_{store}" for ratio in RATIOS for store in stores[1:]]
        wanted += ["p50_ms_of_one_robot_sled", "p50_ms_of_one_robot_nats_1"]
        missing = [key for key in wanted if not figures.get(key, 0) > 0]
        assert not missing, f"{missing} of {figures}"
        print(f"several-servers: {len(figures)} figures")
        large_content(folder, address)


def large_content(folder, address):
    """Meshes in objects and in the stream: a start without objects fetches nothing."""
    experiment = ["experiment", "large-content", "--nats", f"{address}/large"]
    small = ["--megabytes", "0,10", "--starts", "1", "--palpate", sys.argv[1]]
    small += ["--no-record", "--json", "--out", f"{folder}/results"]
    figures = json.loads(palpate(*experiment, *small))["figures"]
    assert figures["fetches_objects_10"] == figures["fetches_stream_10"] == 0, figures
    assert figures["received_mb_objects_10"] < 1 < 10 < figures["received_mb_stream_10"], figures
    assert figures["received_mb_of_a_mesh_objects_10"] > 10, figures
    assert figures["received_mb_of_a_mesh_stream_10"] < 1, figures
    assert figures["start_ratio_10"] > 0 and figures["resident_mb_objects_0"] > 0, figures
    print(f"large-content: {len(figures)} figures")


if __name__ == "__main__":
    main()
