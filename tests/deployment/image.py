"""Checks deploy/Dockerfile against the project, as far as possible without a container engine.

Copied files must exist, files excluded from the build must not be needed by it, and the final
image must have every library that the binary is linked with.
"""

import re
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
IN_FINAL_IMAGE = {"libc.so.6", "libm.so.6", "libgcc_s.so.1", "linux-vdso.so.1"}
"""Libraries of gcr.io/distroless/cc-debian12 that a Rust program may need."""

dockerfile = (ROOT / "deploy/Dockerfile").read_text()
stages = re.findall(r"^FROM (\S+)", dockerfile, re.M)
version = re.search(r'^rust-version = "([\d.]+)"', (ROOT / "Cargo.toml").read_text(), re.M)[1]
assert stages[0].startswith(f"rust:{version}-"), f"{stages[0]} is not Rust {version}"
for needed in ("USER 65532", "HEALTHCHECK", "--locked", "--features full"):
    assert needed in dockerfile, f"deploy/Dockerfile has no {needed}"

left_out = [
    line
    for line in (ROOT / "deploy/Dockerfile.dockerignore").read_text().splitlines()
    if line and not line.startswith("#")
]


def is_left_out(path: Path) -> bool:
    """Whether a path (relative to the project) or its folder is excluded from the build."""
    names = [part.as_posix() for part in [path, *path.parents]]
    # `**/x` is x at any depth, including the top; there are no other wildcards.
    return any(
        fnmatch(name, pattern) or fnmatch("/" + name, pattern.replace("**", "*", 1))
        for name in names
        for pattern in left_out
    )


tracked = subprocess.run(
    ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
    cwd=ROOT, check=True, capture_output=True, text=True,
).stdout.splitlines()  # fmt: skip
for name in ("Cargo.toml", "Cargo.lock", "cli/Cargo.toml", "tests/Cargo.toml", "cli/src/main.rs"):
    assert name in tracked and not is_left_out(Path(name)), f"the build does not see {name}"
for name in tracked:
    if not name.endswith(".rs") or name.startswith("fuzz/"):
        continue
    assert not is_left_out(Path(name)), f"the build does not see {name}"
    for included in re.findall(r'include_(?:str|bytes)!\(\s*"([^"]+)"', (ROOT / name).read_text()):
        path = (ROOT / name).parent.joinpath(included).resolve().relative_to(ROOT)
        assert not is_left_out(path), f"{name} includes {path}, which the build does not see"

linked = subprocess.run(["ldd", sys.argv[1]], check=True, capture_output=True, text=True).stdout
libraries = {line.split()[0] for line in linked.splitlines() if not line.strip().startswith("/")}
assert libraries <= IN_FINAL_IMAGE, f"not in the final image: {libraries - IN_FINAL_IMAGE}"
print(f"sees {len(tracked)} files less {left_out}; needs {', '.join(sorted(libraries))}")
