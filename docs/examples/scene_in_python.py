"""A scene in Python: load a shipped one, change it, run it, look at what it recorded."""

import dsa_des


def main() -> None:
    scene = dsa_des.load_scene("first_light")
    print(scene)

    # Every change gives a new, checked scene; the first one stays as it is.
    slow = scene.set({"duration_s": 60, "blocks.radar.scan_rate_hz": 2})
    simple = slow.swap(radar="radar.threshold", transform="geometry.flat_earth")
    try:
        scene.set({"blocks.radar.scan_rate_hz": -2})
    except dsa_des.SceneError as error:
        print(f"refused: {error}")

    # A run stays in memory; out="FOLDER" writes what `dsa-des run` writes, and returns the same.
    for one in (slow, simple):
        run = dsa_des.run(one)
        radar = [row for row in run.detections.to_pylist() if row["block"] == "radar"]
        print(f"{one.blocks['radar'].type_name}: {len(radar)} detections")
    run.figure("plan").save("plan.png")  # in a notebook, run.figure("plan") shows it

    # Tables are a scene as well; relative paths are those of the working directory.
    table = {
        "title": "One intruder, one radar",
        "duration_s": 30,
        "wires": ["traffic -> transform -> gate -> radar"],
        "blocks": {
            "traffic": {
                "type": "traffic.scripted",
                "ownship": {
                    "lat_deg": 52.0,
                    "lon_deg": 4.4,
                    "alt_m": 1000,
                    "heading_deg": 0,
                    "speed_mps": 50,
                },
                "intruders": [
                    {
                        "name": "head_on",
                        "rcs_dbsm": 10,
                        "east_m": 60,
                        "north_m": 4000,
                        "up_m": 30,
                        "heading_deg": 180,
                        "speed_mps": 60,
                    }
                ],
            },
            "transform": {"type": "geometry.ellipsoid"},
            "gate": {"type": "gate"},
            "radar": {"type": "radar.range_boundary", "scan_rate_hz": 1, "range_km": 3},
        },
    }
    print(dsa_des.run(table))


if __name__ == "__main__":
    main()
