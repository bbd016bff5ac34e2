"""The columns that traffic files may have, for the reference."""

from components.formats import csv_file, daa_file

Row = tuple[str, ...]


def csv_columns() -> list[Row]:
    """Return quantity, accepted names, unit by default, and whether it is needed."""
    return [
        (
            quantity,
            ", ".join(names),
            csv_file.DEFAULT_UNITS.get(quantity, "" if quantity == "id" else "deg"),
            "yes" if quantity in csv_file.REQUIRED else "",
        )
        for quantity, names in csv_file.HEADERS.items()
    ]


def daa_columns() -> list[Row]:
    """Return quantity, accepted names, and unit by default."""
    return [
        (quantity, ", ".join(names), daa_file.DEFAULT_UNITS.get(quantity, ""))
        for quantity, names in (*daa_file.HEADERS.items(), ("yaw", daa_file.EXTRA_HEADERS["yaw"]))
    ]
