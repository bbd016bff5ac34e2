"""The table of docs/autopilots.md: the same encounters with several ways out of them.

``python -m docs.make.foreign.autopilots [NETWORKS]`` prints it, with HorizontalCAS where its
networks are. It takes two minutes.
"""

import socket
import sys
import threading
import tomllib
from pathlib import Path
from typing import Any

import dsa_des
from components.foreign.stand_in_autopilot import answer_and_list_senders

_CONFIGS = Path(__file__).parents[3] / "configs"
_REPLICAS = 200
_CONF = str(_CONFIGS / "alerting/do365b.conf")
_ALERTING = {"type": "alerting.daidalus", "scan_rate_hz": 1, "conf": _CONF, "fit_s": 8}
_BACK = {"from": "avoidance.manoeuvres", "to": "traffic", "delay_s": 1, "holds": "nothing"}


def ways_out(port: int, networks: str | None) -> dict[str, tuple[list[str], dict[str, Any]]]:
    """Return wires and blocks of each, by what the table calls it."""
    avoidance = {"type": "avoidance.daidalus", "conf": _CONF, "beyond_deg": 10}
    turn_away = {"type": "avoidance.turn_away", "range_km": 5, "turn_deg": 45, "pause_s": 60}
    pilot = {
        "type": "foreign.mavlink", "scan_rate_hz": 1, "pace": 0, "answer_s": 5, "lost_s": 60,
        "address": f"127.0.0.1:{port}",
    }  # fmt: skip
    alerted = ["tracker -> alerting", "traffic -> alerting -> avoidance"]
    found: dict[str, tuple[list[str], dict[str, Any]]] = {
        "`avoidance.daidalus`": (alerted, {"alerting": _ALERTING, "avoidance": avoidance}),
        "`avoidance.turn_away`": (["tracker -> avoidance"], {"avoidance": turn_away}),
        "the stand-in": (["traffic -> avoidance"], {"avoidance": pilot}),
    }
    if networks is not None:
        network = {"type": "avoidance.horizontal_cas", "networks": str(Path(networks).resolve())}
        found["HorizontalCAS"] = alerted, {"alerting": _ALERTING, "avoidance": network}
    return found


def row(wires: list[str], blocks: dict[str, Any]) -> list[str]:
    """Return the cells of one way out: shares of encounters, and their ratio with its bounds."""
    scene = tomllib.loads((_CONFIGS / "avoidance/airspace.toml").read_text())
    scene["blocks"] |= blocks
    scene["blocks"]["traffic"]["file"] = str(_CONFIGS / "encounters/light_aircraft.parquet")
    scene["blocks"]["radar"] |= {
        "range_km": 8,
        "azimuth_deg": [-180, 180],
        "elevation_deg": [-60, 60],
    }
    seen = ["traffic -> transform -> gate -> radar", "fusion -> tracker"]
    scene["wires"] = [
        *seen, {"from": "radar", "to": "fusion", "holds": "nothing"}, *wires, _BACK
    ]  # fmt: skip
    draws = {"blocks.traffic.encounter": {"sequence": [0, 1]}}
    study = dsa_des.study(
        scene, replicas=_REPLICAS, seed=1, metrics=["risk_ratio"], draws=draws, workers=1
    )
    of = {one["result"]: one for one in study.summary.to_pylist()}
    cells = []
    for what in ("well_clear_lost", "nmac"):
        shares = [100 * of[f"{what}_{flight}"]["value"] for flight in ("nominal", "mitigated")]
        ratio = of[f"{what}_risk_ratio"]
        bounds = f"{ratio['value']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"
        cells += [f"{shares[0]:.1f} → {shares[1]:.1f} %", bounds]
    return cells


def main() -> None:
    """Print the table."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    threading.Thread(target=answer_and_list_senders, args=(port,), daemon=True).start()
    print("| | well clear lost | ratio | near mid-air collision | ratio |\n|---|---|---|---|---|")
    for name, (wires, blocks) in ways_out(port, next(iter(sys.argv[1:]), None)).items():
        print("| " + " | ".join([name, *row(wires, blocks)]) + " |", flush=True)


if __name__ == "__main__":
    main()
