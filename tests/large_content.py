"""What `/metrics` shows of large content on a NATS cluster, and what a loss of content does.

    large_content.py PALPATE

One server stores a mesh; a second one fetches nothing until it is asked. Then all content is purged
from the bucket, as an operator might do by mistake.
"""

import json
import re
import socket
import struct
import urllib.error
import urllib.request

from nats_servers import cluster, within

# A mesh has a few objects of content.
N_TRIANGLES = 30_000


def mesh(n_triangles, scale):
    """A closed surface as binary STL: a fan of thin wedges about an axis, in metres."""
    from math import cos, pi, sin

    around = [(scale * cos(2 * pi * n / n_triangles), scale * sin(2 * pi * n / n_triangles))
              for n in range(n_triangles)]
    bottom, top = (0.0, 0.0, -scale), (0.0, 0.0, scale)
    file = [bytes(80), struct.pack("<I", 2 * n_triangles)]
    for (x, y), (u, v) in zip(around, around[1:] + around[:1]):
        for corners in ((top, (x, y, 0.0), (u, v, 0.0)), (bottom, (u, v, 0.0), (x, y, 0.0))):
            numbers = [number for corner in corners for number in corner]
            file.append(struct.pack("<12fH", 0, 0, 0, *numbers, 0))
    return b"".join(file)


def put(server, name, file):
    """Uploads the mesh of an object."""
    try:
        server.call("POST", "/v1/objects", {"name": name})
    except urllib.error.HTTPError as error:
        assert error.code == 409, error.read()
    url = f"{server.url}/v1/objects/{name}/mesh?unit=m"
    request = urllib.request.Request(url, file, {"content-type": "model/stl"}, method="PUT")
    with urllib.request.urlopen(request, timeout=60) as answer:
        assert answer.status == 200


def get(server, name):
    with urllib.request.urlopen(f"{server.url}/v1/objects/{name}/mesh", timeout=60) as answer:
        return answer.read()


def figures(server):
    """The metrics of content and of what the cluster sent, by name and reason."""
    with urllib.request.urlopen(f"{server.url}/metrics", timeout=60) as answer:
        text = answer.read().decode()
    pattern = r'^palpate_((?:content|store_received)_\w+)(?:\{reason="(\w+)"\})? (\S+)$'
    found = re.findall(pattern, text, re.M)
    return {f"{name} {reason}".strip(): float(value) for name, reason, value in found}


def purge(address, stream):
    """Takes all messages of a stream, as `nats stream purge` does."""
    host, port = address.split("://")[1].split("/")[0].split(",")[0].split(":")
    with socket.create_connection((host, int(port)), timeout=30) as line:
        said = b'CONNECT {"verbose":false}\r\nSUB answer 1\r\n'
        said += f"PUB $JS.API.STREAM.PURGE.{stream} answer 0\r\n\r\nPING\r\n".encode()
        line.sendall(said)
        heard = b""
        while b'"purged"' not in heard:
            more = line.recv(65536)
            assert more and b"-ERR" not in heard, heard
            heard += more


def expect(figures, **wanted):
    found = {name: figures[name.replace("__", " ")] for name in wanted}
    assert found == wanted, (found, wanted)


def main():
    with cluster() as (_, address, servers):
        run(f"{address}/content", servers)
        servers.expect_no_panic()


def run(address, servers):
    shared = ("--store", address, "--store-shared")
    alone = figures(servers.start("folder"))
    assert len(alone) == 15 and not any(alone.values()), alone

    first = servers.start("first", *shared)
    file = mesh(N_TRIANGLES, 0.05)
    put(first, "wheel", file)
    written = figures(first)
    n_objects = written["content_objects"]
    assert n_objects >= 2 and written["content_bytes"] >= len(file), written
    expect(written, content_puts_total=n_objects, content_fetches_total=0)

    second = servers.start("second", *shared)
    started = figures(second)
    expect(started, content_objects=n_objects, content_puts_total=0, content_fetches_total=0)
    assert 0 < started["store_received_bytes_total"] < len(file) / 3, started
    assert get(second, "wheel") == file
    once = figures(second)
    expect(once, content_fetches_total=n_objects,
           content_fetched_bytes_total=written["content_bytes"])
    assert once["content_cached_bytes"] == written["content_bytes"], once
    assert once["store_received_bytes_total"] > len(file), once
    assert get(second, "wheel") == file
    again = figures(second)
    assert again["content_fetches_total"] == n_objects, again
    assert again["content_cache_hits_total"] >= once["content_cache_hits_total"] + len(file) / 4096
    expect(again, content_missing=0, content_fetches_failed_total__missing=0)

    purge(address, "OBJ_content-content")
    third = servers.start("third", *shared)
    assert third.status("GET", "/v1/objects/wheel/mesh") == 500
    lost = figures(third)
    assert lost["content_fetches_failed_total missing"] == 1, lost
    expect(lost, content_fetches_total=0, content_missing=0)
    third.call("POST", "/v1/compactions")
    expect(figures(third), content_missing=n_objects)
    ready = third.call("GET", "/readyz")
    assert ready["ready"] and all(check["passed"] for check in ready["checks"]), ready
    assert get(second, "wheel") == file, "what was fetched before is still there"

    # What was lost is stored again.
    put(third, "wheel", file)
    assert get(third, "wheel") == file
    third.call("POST", "/v1/compactions")
    expect(figures(third), content_missing=0, content_objects=n_objects)
    within(10, "the other server hears of it", lambda: get(first, "wheel") == file)
    print(f"content: {json.dumps(figures(third))}")


if __name__ == "__main__":
    main()
