"""Checks what `kubectl kustomize` makes of deploy/kubernetes: `cluster.py MANIFESTS NATIVE`.

Writes the objects that Kubernetes itself has to NATIVE, for a check of their schemas. Objects of the
Prometheus operator are checked by its models, the alerts against those of Prometheus, and names that
one object has of another against that one.
"""

import sys
from pathlib import Path

import yaml
from cloudcoil.models.prometheus_operator import v1

ROOT = Path(__file__).resolve().parents[2]
MODELS = {"ServiceMonitor": v1.ServiceMonitor, "PrometheusRule": v1.PrometheusRule}

objects = [found for found in yaml.safe_load_all(Path(sys.argv[1]).read_text()) if found]
operator = [found for found in objects if found["apiVersion"].startswith("monitoring.coreos.com/")]
native = [found for found in objects if found not in operator]
Path(sys.argv[2]).write_text(yaml.safe_dump_all(native))


def of(kind, name="palpate"):
    """The object of a kind and a name."""
    found = [it for it in objects if it["kind"] == kind and it["metadata"]["name"] == name]
    assert len(found) == 1, f"{len(found)} objects {kind} {name}"
    return found[0]


for it in operator:
    model = MODELS[it["kind"]].model_validate(it)
    # The models drop what they do not know.
    known = model.model_dump(mode="json", by_alias=True, exclude_unset=True)
    assert known == it, f"{it['kind']}: unknown fields, or values of another form: {known} is not {it}"

alerts = yaml.safe_load((ROOT / "deploy/prometheus/alerts.yml").read_text())
assert of("PrometheusRule")["spec"] == alerts, (
    "the alerts are not those of deploy/prometheus/alerts.yml: "
    "write them with `tests/deployment/rules.py`"
)

state = of("StatefulSet")["spec"]
pod = state["template"]
pods = of("Service", state["serviceName"])
assert pods["spec"]["clusterIP"] == "None", "the service of the StatefulSet is not headless"
labels = pod["metadata"]["labels"].items()
ports = {port["name"]: port["containerPort"] for port in pod["spec"]["containers"][0]["ports"]}
for name in ("palpate", state["serviceName"]):
    service = of("Service", name)["spec"]
    assert service["selector"].items() <= labels, f"the service {name} selects no pod"
    assert all(port["targetPort"] in ports for port in service["ports"]), name
monitor = of("ServiceMonitor")["spec"]
selected = [
    it["metadata"]["name"]
    for it in objects
    if it["kind"] == "Service"
    and monitor["selector"]["matchLabels"].items() <= it["metadata"]["labels"].items()
]
assert selected == [state["serviceName"]], f"Prometheus would ask {selected}"
assert pods["metadata"]["labels"][monitor["jobLabel"]] == "palpate"
service_ports = {port["name"] for port in pods["spec"]["ports"]}
assert {endpoint["port"] for endpoint in monitor["endpoints"]} <= service_ports

policy = of("NetworkPolicy")["spec"]
assert policy["podSelector"]["matchLabels"].items() <= labels
cron = of("CronJob", "palpate-backup")["spec"]["jobTemplate"]["spec"]["template"]
admitted = [peer["podSelector"]["matchLabels"] for peer in policy["ingress"][0]["from"] if "podSelector" in peer]
assert any(peer.items() <= cron["metadata"]["labels"].items() for peer in admitted), "no backup gets in"
for spec in (pod["spec"], cron["spec"]):
    mounts = {mount["name"] for mount in spec["containers"][0]["volumeMounts"]}
    there = {volume["name"] for volume in spec["volumes"]}
    there |= {claim["metadata"]["name"] for claim in state["volumeClaimTemplates"]}
    assert mounts <= there, mounts - there
    assert spec["containers"][0]["resources"]["limits"]["memory"]
claims = {it["metadata"]["name"] for it in objects if it["kind"] == "PersistentVolumeClaim"}
assert cron["spec"]["volumes"][0]["persistentVolumeClaim"]["claimName"] in claims
backend = of("Ingress")["spec"]["rules"][0]["http"]["paths"][0]["backend"]["service"]
assert backend["port"]["name"] in {port["name"] for port in of("Service", backend["name"])["spec"]["ports"]}

# One time to stop everywhere.
compose = yaml.safe_load((ROOT / "deploy/compose.yaml").read_text())["services"]["palpate"]
unit = (ROOT / "deploy/systemd/palpate.service").read_text()
assert pod["spec"]["terminationGracePeriodSeconds"] == 60
assert compose["stop_grace_period"] == "1m" and "\nTimeoutStopSec=60\n" in unit
print(f"{len(native)} objects of Kubernetes, {len(operator)} of the Prometheus operator")
