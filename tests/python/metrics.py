"""Reads the text of a scrape from standard input with Prometheus's own parsers; prints what it says as JSON.

Usage: metrics.py text|openmetrics
"""

import json
import math
import sys

from prometheus_client import openmetrics, parser
import prometheus_client.openmetrics.parser

parse = {
    "text": parser.text_string_to_metric_families,
    "openmetrics": openmetrics.parser.text_string_to_metric_families,
}[sys.argv[1]]

families = []
for family in parse(sys.stdin.read()):
    assert family.documentation, f"{family.name} is not explained"
    assert family.type != "unknown", f"{family.name} has no type"
    samples = [
        {"name": sample.name, "labels": sample.labels, "value": sample.value if math.isfinite(sample.value) else None}
        for sample in family.samples
    ]
    families.append({"name": family.name, "type": family.type, "samples": samples})
    if family.type != "histogram":
        continue
    # What makes a histogram one, for every set of labels.
    series = {}
    for sample in family.samples:
        labels = {name: value for name, value in sample.labels.items() if name != "le"}
        one = series.setdefault(json.dumps(labels, sort_keys=True), {"buckets": []})
        if sample.name.endswith("_bucket"):
            one["buckets"].append((float(sample.labels["le"]), sample.value))
        else:
            one[sample.name.rsplit("_", 1)[1]] = sample.value
    for labels, one in series.items():
        bounds, counts = zip(*one["buckets"])
        assert list(bounds) == sorted(bounds) and bounds[-1] == math.inf, (labels, bounds)
        assert list(counts) == sorted(counts) and counts[-1] == one["count"], (labels, counts)
        least = sum(b * (c - before) for b, c, before in zip((0, *bounds), counts, (0, *counts)))
        assert one["sum"] >= 0.9 * least, (labels, one["sum"], least)

json.dump(families, sys.stdout)
