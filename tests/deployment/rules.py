"""Writes the alerts of deploy/prometheus/alerts.yml as an object of the Prometheus operator."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HEAD = """\
# Written by tests/deployment/rules.py from deploy/prometheus/alerts.yml: change that.
apiVersion: monitoring.coreos.com/v1
kind: PrometheusRule
metadata:
  name: palpate
  labels:
    app.kubernetes.io/name: palpate
spec:
"""

alerts = (ROOT / "deploy/prometheus/alerts.yml").read_text()
rules = alerts[alerts.index("groups:") :].splitlines()
body = "".join(f"  {line}\n" if line else "\n" for line in rules)
(ROOT / "deploy/kubernetes/monitoring/prometheusrule.yaml").write_text(HEAD + body)
