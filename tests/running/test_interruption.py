"""Signals end a program in one line and with their own exit code, but never half of a step."""

import signal
import threading

import pytest

from dsa_des.terminal.interruption import Terminated, defer_signals, exit_plainly_on_signal

ENDS = [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]


@pytest.fixture(autouse=True)
def _usual_handlers():
    """The handlers of a fresh Python, whatever runs the tests has installed."""
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(("number", "code", "word"), ENDS)
def test_a_signal_is_one_line_and_an_exit_code(number, code, word, capsys):
    cleared = []
    with pytest.raises(SystemExit) as ended, exit_plainly_on_signal():
        try:
            signal.raise_signal(number)
        finally:
            cleared.append(True)
    assert ended.value.code == code and cleared
    assert capsys.readouterr().err == f"stopped: {word}\n"


@pytest.mark.parametrize(("number", "code", "word"), ENDS)
@pytest.mark.parametrize("then", [ImportError("half"), SystemExit(2), SystemExit(0), None])
def test_whatever_comes_of_a_signal_counts_as_it(number, code, word, then, capsys):
    with pytest.raises(SystemExit) as ended, exit_plainly_on_signal():
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            if then is not None:
                raise then from None
    assert ended.value.code == code


def test_who_has_said_it_already_is_not_repeated(capsys):
    with pytest.raises(SystemExit) as ended, exit_plainly_on_signal():
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            raise SystemExit(130) from None
    assert ended.value.code == 143
    assert capsys.readouterr().err == ""


def test_one_inside_the_other_says_it_once(capsys):
    with pytest.raises(SystemExit) as ended, exit_plainly_on_signal(), exit_plainly_on_signal():
        signal.raise_signal(signal.SIGTERM)
    assert ended.value.code == 143
    assert capsys.readouterr().err == "stopped: terminated\n"


def test_other_ends_stay_as_they_are():
    with exit_plainly_on_signal():
        pass
    with pytest.raises(SystemExit) as ended, exit_plainly_on_signal():
        raise SystemExit(2)
    assert ended.value.code == 2
    with pytest.raises(ValueError, match="mine"), exit_plainly_on_signal():
        raise ValueError("mine")


def test_ignored_signals_stay_ignored(capsys):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with exit_plainly_on_signal(), defer_signals():
        signal.raise_signal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("number", "code", "word"), ENDS)
def test_a_step_that_must_not_be_halved_is_finished_first(number, code, word):
    done = []
    with pytest.raises(SystemExit) as ended, exit_plainly_on_signal():
        with defer_signals(), defer_signals():
            signal.raise_signal(number)
            signal.raise_signal(number)
            done.append("step")
        done.append("after")
    assert ended.value.code == code and done == ["step"]


def test_an_error_of_the_step_itself_is_not_lost_when_no_signal_comes():
    with pytest.raises(ValueError, match="mine"), defer_signals():
        raise ValueError("mine")


def test_a_thread_that_is_not_the_main_one_is_left_alone():
    passed = []

    def work():
        with exit_plainly_on_signal(), defer_signals():
            passed.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert passed


def test_simpy_can_make_the_exception_again():
    original = Terminated(15)
    assert type(original)(*original.args).args == (15,)
