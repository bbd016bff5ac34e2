"""``dsa-des cdti``: one session, from the scene to its run folder."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from components.cdti.control import LivePacer, SessionControl
from components.cdti.page import Admission
from components.cdti.scope import Scope
from components.operator.human import Desk, Human
from components.operator.recorded import RecordedOperator
from dsa_des.commands.scene import text_of_check_command
from dsa_des.errors import UsageError
from dsa_des.files.output_folder import OutputFolder
from dsa_des.library.scenes import load_scene
from dsa_des.running.pacing import parse_factor
from dsa_des.running.recorded_run import record_run
from dsa_des.running.simulation import Simulation
from dsa_des.scene.examples import find_input_file
from dsa_des.scene.scene import Scene
from dsa_des.terminal.interruption import Terminated
from dsa_des.terminal.terminal import say
from dsa_des.text.safe_text import escape_unprintable

_LOOPBACK = ("127.0.0.1", "::1", "localhost")
_EVERYWHERE = ("0.0.0.0", "::", "")
_DECIDED = "It lets one browser decide; whoever opens it after that watches."
_WATCHED = "The scene has no operator.human block: browsers watch, nobody decides."


def run_session(
    scene: str,
    sets: tuple[str, ...],
    swaps: tuple[str, ...],
    seed: int | None,
    duration: str | None,
    realtime: str,
    out: str | None,
    host: str,
    port: int,
    units: str,
    platform: str | None,
    no_wait: bool,
    no_figures: bool,
) -> None:
    """Run a scene with its display, and keep the run also when it is interrupted."""
    try:
        from components.cdti.server import DisplayServer
    except ImportError as error:
        if not (error.name or "").startswith("websockets"):
            raise
        raise UsageError(
            "dsa-des cdti needs the package websockets: pip install 'dsa-des[view]'"
        ) from None
    speed = parse_factor(realtime)
    _check_host(host)
    # By its whole path, so that the run folder's scene finds its files from wherever it is run.
    path = Path(os.path.abspath(find_input_file(scene, "scene")))
    loaded = load_scene(path, sets=sets, swaps=swaps, seed=seed, duration_s=duration)
    console = _console_block_name(loaded)
    target = OutputFolder.from_option(out, Path("runs"), loaded.path.stem)
    target.check()
    replay = _scene_for_replay(loaded, console, target.path)
    desk = Desk()
    control = SessionControl(
        loaded, desk, console, speed, units, waits=not no_wait and console is not None
    )
    admission = Admission()
    server = DisplayServer(host, port, admission, control)
    pacer = LivePacer(speed, control.is_held, control.show_time)
    control.attach(server, pacer, admission)
    server.start()
    say(f"display: {server.page_url(admission.token)}")
    say(f"{_WATCHED if console is None else _DECIDED} Ctrl-C ends the run.")
    if host not in _LOOPBACK:
        open_to = f"note: others in the network of {host} can reach it"
        say(f"{open_to}, and what is sent is not encrypted", err=True)

    def prepare(simulation: Simulation) -> None:
        scope = Scope(simulation, platform)
        if simulation.recorder is not None:
            simulation.recorder.listeners.append(scope.store_message)
        if console is not None:
            block = simulation.components[console]
            assert isinstance(block, Human)
            block.desk = desk
        control.scope = scope

    ended = "the run was broken off"
    received: list[int] = []
    try:
        with _stop_on_signals(pacer, received):
            summary = record_run(
                loaded,
                target,
                silent=True,
                notes_command=text_of_check_command(scene, sets, swaps, seed, duration),
                pacer=pacer,
                draw=not no_figures,
                prepare=prepare,
                recorded_as=replay,
            )
        ended = "interrupted" if received else "the scene has come to its end"
    finally:
        desk.close()
        server.close({"type": "end", "why": ended})
    say(
        f"run: {escape_unprintable(str(summary['out']))}: {control.decisions_sentence()}; "
        f"{pacer.sentence()}"
    )
    if received:
        raise KeyboardInterrupt if received[0] == signal.SIGINT else Terminated(received[0])


def _console_block_name(scene: Scene) -> str | None:
    """Return the block at which a person decides (name); None for a scene that is only watched."""
    result = [name for name, cls in scene.classes.items() if issubclass(cls, Human)]
    if len(result) > 1:
        raise UsageError(
            f"{scene.path}: {', '.join(result)} are all of type operator.human: one person sits at "
            "one console"
        )
    return result[0] if result else None


def _scene_for_replay(scene: Scene, console: str | None, target: Path) -> Scene | None:
    """Return the scene with the console replaced by the decisions recorded in this run, which gives
    the same tables; None without a console.
    """
    if console is None:
        return None
    table = (target / "decisions.parquet").absolute()
    block = scene.blocks[console]
    kept = {
        key: value
        for key, value in block.parameters.model_dump(mode="json").items()
        if key in RecordedOperator.Parameters.model_fields
    }
    options = block.options.model_dump(mode="json", exclude_unset=True)
    recorded = {"type": "operator.recorded", **kept, **options, "decisions": str(table)}
    return scene.set({f"blocks.{console}": recorded})


def _check_host(host: str) -> None:
    if host in _EVERYWHERE:
        raise UsageError(
            f"--host {host!r}: name the address under which others reach this machine: pages that "
            "came from any other name are refused"
        )


@contextmanager
def _stop_on_signals(pacer: LivePacer, received: list[int]) -> Iterator[None]:
    """Make ctrl-C and SIGTERM end the run at its next instant; a second signal aborts it."""

    def handle(number: int, frame: FrameType | None) -> None:
        if received:
            raise KeyboardInterrupt if number == signal.SIGINT else Terminated(number)
        received.append(number)
        pacer.stop()

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {n: signal.signal(n, handle) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, there in before.items():
            signal.signal(number, there)
