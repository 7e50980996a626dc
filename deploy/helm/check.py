"""Lints and renders the chart, holds it against its golden files, and validates what it renders."""
import difflib
import pathlib
import sys

import helm_python as helm
import kubernetes_validate
import yaml

HERE = pathlib.Path(__file__).parent
KUBERNETES = "1.31"
# Values by the name of their golden file.
CASES = {
    "plain": {},
    "guarded": {
        "tls": {"secret": "cell-tls", "clientCa": "cell-clients"},
        "tokens": {"secret": "cell-tokens"},
        "config": {"log": {"format": "json", "filter": "debug"}, "limits": {"calls": 128, "queue_ms": 200}},
        "serviceMonitor": {"enabled": True},
        "networkPolicy": {"from": [{"namespaceSelector": {"matchLabels": {"name": "planners"}}}]},
        "persistence": {"existingClaim": "catalogue"},
        "image": {"tag": "1.2.3"},
    },
}
# Values that the schema has to refuse, and what it has to name.
REFUSED = [
    ({"replicas": 3}, "replicas"),
    ({"service": {"port": 0}}, "port"),
    ({"persistence": {"size": "lots"}}, "size"),
    ({"config": {"listen": "0.0.0.0:1"}}, "listen"),
    ({"config": {"limits": {"calls": "many"}}}, "calls"),
]


def rendered(chart, values):
    files = chart.render(values, name="cell", namespace="robots")
    return {path: text for path, text in sorted(files.items()) if text.strip() and not path.endswith(".tpl")}


def main(update):
    report = helm.lint(HERE / "sublevel", strict=True)
    faults = [message for message in report["messages"] if message["severity"] > 1] + report["errors"]
    assert not faults, faults
    chart = helm.Chart.load(HERE / "sublevel")
    for name, values in CASES.items():
        files = rendered(chart, values)
        for path, text in files.items():
            for document in yaml.safe_load_all(text):
                # What an operator brings is not part of Kubernetes.
                if document and document["kind"] != "ServiceMonitor":
                    kubernetes_validate.validate(document, KUBERNETES, strict=True)
        text = "".join(f"--- # {path}\n{text.strip()}\n" for path, text in files.items())
        golden = HERE / "golden" / f"{name}.yaml"
        if update:
            golden.parent.mkdir(exist_ok=True)
            golden.write_text(text)
        difference = list(difflib.unified_diff(golden.read_text().splitlines(), text.splitlines(), "golden", "rendered"))
        assert not difference, f"{golden}: render again with deploy/check --update\n" + "\n".join(difference)
        pod = next(yaml.safe_load(text) for text in files.values() if "kind: StatefulSet" in text)["spec"]["template"]["spec"]
        container = pod["containers"][0]["securityContext"]
        assert pod["securityContext"]["runAsNonRoot"] and container["readOnlyRootFilesystem"]
    for values, word in REFUSED:
        try:
            chart.validate_schema(chart.merge_values(values))
        except helm.HelmValuesError as error:
            assert word in str(error), f"{values}: {error}"
        else:
            raise AssertionError(f"{values} is accepted")
    print(f"{len(CASES)} renders of the chart, {len(REFUSED)} refusals of its schema")


if __name__ == "__main__":
    main("--update" in sys.argv[1:])
