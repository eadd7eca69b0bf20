"""A policy that changes lanes only for more than a margin: the value of keeping is raised by it.

pip install "./python[train]"
python tools/keep_margin.py policies/table2.safetensors --margin-s 0.1 --out runs/margin/policy.safetensors

`--company-s` adds a margin for every vehicle that the newest frame shows beyond `--beyond` of them; a
training whose rollouts keep to the margin as well is `python -m tractrix.train.rollout --company-s`.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from tractrix.train.export import export, network_of
from tractrix.train.margin import with_margins


def main() -> None:
    """Writes the policy and its sidecar."""
    parser = argparse.ArgumentParser(
        formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("--out", type=Path, required=True, help=" ")
    parser.add_argument("--margin-s", type=float, default=0.0, help=" ")
    parser.add_argument("--company-s", type=float, default=0.0, help=" ")
    parser.add_argument("--beyond", type=float, default=1.0, help="vehicles")
    given = parser.parse_args()
    sidecar = json.loads(given.file.with_suffix(".json").read_text())
    margins = {
        "margin_s": given.margin_s,
        "company_s": given.company_s,
        "beyond": given.beyond,
    }
    export(
        with_margins(network_of(given.file), **margins),
        given.out,
        spec="ours",
        seeds=sidecar["seeds"],
        training=sidecar["training"] | {"keep_margin": margins},
        evaluation={},
    )


if __name__ == "__main__":
    main()
