"""What a number of ours rests on: predicted, calibrated or configured, and by which inputs."""

from dataclasses import dataclass

_SENTENCES = {
    "predicted": "Predicted from {}.",
    "calibrated": "Set from it: {}.",
    "configured": "An input of ours: {}.",
}


@dataclass(frozen=True)
class Basis:
    """Where a number of ours comes from.

    Parameters
    ----------
    kind : {"predicted", "calibrated", "configured"}
    words : str
        What it was predicted from, which parameter was set from the printed number, or which
        input it is, in a few words.
    inputs : tuple of str
        The parameters, each as ``file:key`` of the folder ``configs`` or ``module:CONSTANT`` of
        this package. A calibrated or configured number moves with each of them. No parameter of a
        predicted number was set from the number that it is compared with.
    """

    kind: str
    words: str
    inputs: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """Return kind and words as one sentence."""
        return _SENTENCES[self.kind].format(self.words)


def predicted(words: str, *inputs: str) -> Basis:
    """Return the basis of a number to which nothing was fitted."""
    return Basis("predicted", words, inputs)


def calibrated(words: str, *inputs: str) -> Basis:
    """Return the basis of a number from which a parameter was set."""
    return Basis("calibrated", words, inputs)


def configured(words: str, *inputs: str) -> Basis:
    """Return the basis of a number that is an input of ours."""
    return Basis("configured", words, inputs)
