"""What every block that decides by a ``.conf`` file is told: the file, and whose levels count."""

from typing import Any

from pydantic import Field, field_validator

from components.alert_configuration.conf_file import read_conf
from components.alert_configuration.configuration import Alerter, Configuration
from dsa_des.block.component import Parameters, ScenePath


class ConfParameters(Parameters):
    """A configuration and the alerter of all targets."""

    conf: ScenePath = Field(
        description="Volumes, times and rate of turn: a .conf file of DAIDALUS."
    )
    alerter: int = Field(
        default=1, ge=1, description="Which alerter of the file all targets belong to, from 1."
    )

    @field_validator("conf", mode="after")
    @classmethod
    def _readable(cls, value: Any) -> Any:
        read_conf(value)
        return value

    def read(self) -> tuple[Configuration, Alerter]:
        """Return the configuration and the alerter.

        Raises
        ------
        ValueError
            The file has fewer alerters.
        """
        configuration = read_conf(self.conf)
        count = len(configuration.alerters)
        if self.alerter > count:
            raise ValueError(
                f"alerter is {self.alerter}: it must be at most {count}, the number of alerters "
                f"of {self.conf}"
            )
        return configuration, configuration.alerters[self.alerter - 1]
