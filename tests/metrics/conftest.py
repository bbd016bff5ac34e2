"""A small study to measure."""

from tests.studies.conftest import small

__all__ = ["small"]
