"""A study in Python: declaration range over the scan rate of the radar, as a table."""

from importlib.util import find_spec

import dsa_des


def main() -> None:
    scene = dsa_des.load_scene("first_light").set(
        {
            "duration_s": 60,
            "blocks.eo.enabled": False,
            "blocks.ir.enabled": False,
        }
    )
    declared = {"metric": "declaration", "m": 3, "n": 5, "sensors": ["radar"]}
    result = dsa_des.study(
        scene,
        axes={"blocks.radar.scan_rate_hz": [1, 2, 5]},
        draws={"blocks.radar.offset_s": {"uniform": [0, 1]}},
        metrics=["first_detection", declared],
        replicas=20,
        workers=2,
    )
    print(result)
    # `summary` is an Arrow table. Pandas comes with: pip install "dsa-des[pandas]"
    if find_spec("pandas") is not None:
        columns = ["radar.scan_rate_hz", "result", "value"]
        print(result.summary.to_pandas()[columns].to_string(index=False))
        return
    for row in result.summary.to_pylist():
        print(f"{row['radar.scan_rate_hz']:4} Hz  {row['result']}: {row['value']}")


if __name__ == "__main__":
    main()
