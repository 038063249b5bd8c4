"""Small runs of `palpate experiment several-servers` and `divided-servers` on three NATS servers.

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
        divided(folder, address)


def divided(folder, address):
    """A catalogue of two blocks: equal beliefs, and less memory a server."""
    experiment = ["experiment", "divided-servers", "--nats", f"{address}/divided"]
    small = ["--objects", "70", "--train-readings", "60", "--sessions", "3", "--readings", "4"]
    small += ["--palpate", sys.argv[1], "--no-record", "--json", "--out", f"{folder}/results"]
    figures = json.loads(palpate(*experiment, *small))["figures"]
    assert figures["equal_2"] == figures["equal_4"] == 1, figures
    assert figures["surface_ratio_2"] < 1, figures
    assert figures["resident_mb_1"] > 0 and figures["p99_ms_4"] > 0, figures
    print(f"divided-servers: {len(figures)} figures")


if __name__ == "__main__":
    main()
