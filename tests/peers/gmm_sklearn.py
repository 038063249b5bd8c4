"""Gaussian mixtures: our training time against scikit-learn's on the same features.

Both fit full covariances to the same 10,000 features in one run, one after the other, from
k-means++ with the same number of starts, until the mean ln density of a feature gains less
than the same tolerance. The printed log-likelihoods show whether both found the same mixture.

    python3 -m venv /tmp/peers && /tmp/peers/bin/pip install scikit-learn
    cargo build --release -p palpate-core --example gmm_peer
    export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 RAYON_NUM_THREADS=1
    /tmp/peers/bin/python tests/peers/gmm_sklearn.py target/release/examples/gmm_peer

Both use one core: without the three variables scikit-learn's BLAS waits for cores on a busy
machine (measured 7 to 10 times slower).
"""

import argparse
import os
import subprocess
import tempfile
import time
import warnings

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.mixture import GaussianMixture


THREAD_VARIABLES = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"]


def ours(program, file, args, tolerance):
    """Milliseconds and mean ln density of our fit."""
    command = [program, file, args.n, args.dimension, args.components, args.starts, tolerance]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=True)
    milliseconds, reached, n_components = done.stdout.split()
    return float(milliseconds), float(reached), int(n_components)


def theirs(features, n_components, args):
    """Milliseconds and mean ln density of scikit-learn's fit."""
    mixture = GaussianMixture(
        n_components,
        covariance_type="full",
        tol=args.tolerance,
        max_iter=200,
        n_init=args.starts,
        init_params="k-means++" if args.no_kmeans else "kmeans",
        random_state=101,
    )
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        mixture.fit(features)
    elapsed = 1e3 * (time.perf_counter() - start)
    return elapsed, mixture.score(features), mixture.n_iter_


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="the built example gmm_peer")
    parser.add_argument("--n", type=int, default=10_000)
    parser.add_argument("--dimension", type=int, default=20)
    parser.add_argument("--components", type=int, nargs="+", default=[25, 60])
    parser.add_argument("--starts", type=int, default=1)
    parser.add_argument("--tolerance", type=float, default=1e-3, help="gain of the mean ln density")
    parser.add_argument("--no-kmeans", action="store_true", help="their start without k-means")
    args = parser.parse_args()
    threads = [f"{name}={os.environ.get(name, '-')}" for name in THREAD_VARIABLES]
    print(f"{args.n} features of {args.dimension} values, {os.cpu_count()} CPUs, {' '.join(threads)}")
    for components in args.components:
        case = argparse.Namespace(**{**vars(args), "components": components})
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "features.f64")
            # Our tolerance is a share of the density; the first, loose fit gives its size.
            _, size, _ = ours(args.program, file, case, 1e-2)
            tolerance = args.tolerance / max(1.0, abs(size))
            our_ms, our_reached, n_components = ours(args.program, file, case, tolerance)
            features = np.fromfile(file).reshape(args.n, args.dimension)
        their_ms, their_reached, steps = theirs(features, n_components, args)
        print(
            f"{n_components} components: ours {our_ms:.0f} ms, mean ln density {our_reached:.4f}; "
            f"scikit-learn {their_ms:.0f} ms, {their_reached:.4f} ({steps} steps); "
            f"ratio {their_ms / our_ms:.2f}"
        )


if __name__ == "__main__":
    main()
